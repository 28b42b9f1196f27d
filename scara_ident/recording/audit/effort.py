"""Faults of recorded efforts: dead or stuck channels, saturation."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.manners import several
from scara_ident.recording.audit.samples import (
    IDLE_TRAVEL,
    Checked,
    Finding,
    Samples,
    joint_range,
    levels,
    resolution,
    runs,
)

# An effort that keeps one value for longer than this while its joint moves is stuck ...
STUCK_SECONDS = 0.2
# ... and dead where it does so for this share of the recording.
DEAD_SHARE = 0.5
# Where more than this share of the other samples repeats the one before, the effort has no noise (a simulation, a
# coarse converter), and a value that lasts says nothing, unless it lasts for most of the time and so many times
# longer than any other does.
NOISELESS, OUTLASTING = 0.5, 10.0
# Where more than this share of the other samples repeats the one before, values last by chance: rounded to steps like its
# noise an effort does so for 0.3 s at 10 Hz. Less than this expected number of such runs in a recording is no chance.
REPEATED_SHARE, CHANCE = 0.02, 1e-3
# An effort without noise is one value as well while all joints keep their speed, to this share of the way.
STEADY_SHARE = 1e-3
# Differences of this order and the next tell noise, which makes the next larger; rounding makes it so many smallest steps.
ORDER, ROUNDING_STEPS = 4, 4.0
# A saturated amplifier holds its extreme for this many samples in a row, ...
PILE_RUN = 3
# ... for this share of the recording in all, ...
PILE_SHARE = 1e-3
# ... and this many times more often than it takes the values next to it: a quantised sine reaches 3.
PILE_UP = 5.0
NEXT_VALUES = 3
# Of so few values one is more than a twentieth of all that a joint's effort does.
FEW_VALUES = 24


def dead_effort(samples: Samples) -> Checked:
    """Refuse a dead effort of a joint that moves; leave out rows where it is stuck, of that joint alone where most are."""
    if samples.effort is None:
        return samples, []
    idle = samples.idle()
    found = []
    keep = np.ones(samples.count, dtype=bool)
    for joint, values in enumerate(samples.effort):
        name = samples.robot.joints[joint]
        same = values[1:] == values[:-1]
        if same.all():
            if not idle[joint]:
                samples.refuse(
                    f"{name}.effort is {values[0]:g} throughout although the joint moves by "
                    f"{np.ptp(samples.position[joint]):.3g} {samples.robot.position_unit(joint)}: a dead channel; "
                    f"record it again, or identify without {name} from recordings in which that joint does not move"
                )
            said = f"{name}.effort is {values[0]:g} throughout, and the joint does not move: used as it is"
            found.append(Finding("dead_effort", said, samples.count))
            continue
        stuck = _stuck(samples, joint, same)
        count = int(stuck.sum())
        if not count:
            continue
        first = samples.where(int(np.argmax(stuck)))
        value = values[np.argmax(stuck)]
        what = f"{name}.effort is stuck at {value:g} from {first}"
        if count > DEAD_SHARE * samples.count:
            what += f", {count} of {samples.count} rows, while the joint moves"
            # Too much to cut out for all joints; the others may be whole.
            if np.any(values[stuck] != value) or np.sum(~idle) < 2:
                samples.refuse(f"{what}; cut the file there")
            torque = float(value * samples.robot.effort_gain[joint])
            said = f"{what}: left out of the fit of {name}, wherever it is {value:g}"
            found.append(Finding("stuck_effort", said, count, (joint, torque)))
            continue
        keep &= ~stuck
        said = f"{what} while the joint moves: {several(count, 'row')} left out"
        found.append(Finding("stuck_effort", said, count))
    return samples.kept(keep), found


def copies(samples: Samples) -> Checked:
    """Refuse an effort that holds another joint's numbers: one of the two was never recorded."""
    if samples.effort is None:
        return samples, []
    # Two that are dead most of the time are alike by that, and the two motors of a wrist may be in what is left.
    alive = [joint for joint in np.flatnonzero(~samples.idle()).tolist() if not _mostly_one(samples.effort[joint])]
    for one, other in combinations(alive, 2):
        alike = np.array_equal(samples.position[one], samples.position[other])
        if not alike and np.array_equal(np.abs(samples.effort[one]), np.abs(samples.effort[other])):
            first, second = samples.robot.joints[one], samples.robot.joints[other]
            samples.refuse(
                f"{second}.effort has the numbers of {first}.effort in every row: one of them was written, or mapped, "
                "twice; correct the log, or recording: in robot.yaml"
            )
    return samples, []


def saturation(samples: Samples) -> Checked:
    """Say where efforts pile up at their extremes: what they were there is not known."""
    if samples.effort is None:
        return samples, []
    found = []
    for joint, values in enumerate(samples.effort):
        for extreme, direction in ((values.max(), -1), (values.min(), 1)):
            at = values == extreme
            count = int(at.sum())
            if count < max(PILE_RUN, PILE_SHARE * samples.count) or count == samples.count:
                continue
            if not _piles_up(values, at, direction):
                continue
            start, _ = runs(at[1:] & at[:-1])
            name, torque = samples.robot.joints[joint], extreme * samples.robot.effort_gain[joint]
            said = (
                f"{name}.effort stays at its extreme {extreme:.4g} ({torque:.4g} {samples.robot.torque_unit(joint)}) "
                f"for {100 * count / samples.count:.2g} % of the rows, first in {samples.where(int(start[0]))}: "
                "the amplifier saturates or the log is clipped; left out of the fit"
            )
            found.append(Finding("saturation", said, count, (joint, float(torque))))
    return samples, found


def coarse_effort(samples: Samples) -> Checked:
    """Say where efforts of a moving joint take a few values only: how they are rounded repeats with the motion."""
    if samples.effort is None:
        return samples, []
    found = []
    for joint in np.flatnonzero(~samples.idle()).tolist():
        values = levels(samples.effort[joint])
        if not 1 < len(values) <= min(FEW_VALUES, samples.count // 10):
            continue
        torque = float(np.min(np.diff(values))) * abs(samples.robot.effort_gain[joint])
        name = samples.robot.joints[joint]
        said = (
            f"{name}.effort takes {len(values)} values only, {torque:.3g} "
            f"{samples.robot.torque_unit(joint)} apart: the rounding error repeats with the motion and may look like "
            f"an effect; record it with a finer resolution"
        )
        found.append(Finding("coarse_effort", said, samples.count, joint=name))
    return samples, found


def _mostly_one(values: Array) -> bool:
    """Tell whether an effort has one value most of the time."""
    return bool(np.max(np.unique(values, return_counts=True)[1]) > DEAD_SHARE * len(values))


def _stuck(samples: Samples, joint: int, same: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Tell which samples repeat a stuck effort, shape (N,)."""
    assert samples.effort is not None
    values = samples.effort[joint]
    stuck = np.zeros(samples.count, dtype=bool)
    start, length = runs(same)
    end = start + length - 1
    long = samples.time[end] - samples.time[start] > STUCK_SECONDS
    long &= (values[start] != values.max()) & (values[start] != values.min()) | (length > DEAD_SHARE * samples.count)
    least = IDLE_TRAVEL * joint_range(samples.robot)[joint]

    def moves(run: int) -> bool:
        return bool(np.ptp(samples.position[joint, start[run] : end[run] + 1]) > least)

    found = [run for run in np.flatnonzero(long).tolist() if moves(run)]
    for run in found:
        stuck[start[run] : end[run] + 1] = True
    elsewhere = ~(stuck[1:] & stuck[:-1])
    if found and elsewhere.any() and np.mean(same[elsewhere]) > NOISELESS:
        by_length = np.argsort(-length, kind="stable").tolist()
        value = values[start[max(found, key=lambda run: length[run])]]
        # Without another value that lasts in motion nothing says how long one may.
        usual = next((length[run] for run in by_length if values[start[run]] != value and moves(run)), samples.count)
        most = max(OUTLASTING * usual, DEAD_SHARE * samples.count)
        found = [run for run in found if values[start[run]] == value and length[run] > most]
    if found:
        shorter = length[~np.isin(np.arange(len(length)), found)]
        longest = _by_chance(float(np.mean(same[elsewhere])) if elsewhere.any() else 0.0, shorter, samples.count)
        found = [run for run in found if length[run] > longest]
    if found and without_noise(values, ~stuck):
        found = [run for run in found if not _steady(samples, start[run], end[run])]
    stuck[:] = False
    for run in found:
        stuck[start[run] : end[run] + 1] = True
    return stuck


def _by_chance(share: float, lengths: NDArray[np.intp], count: int) -> float:
    """Return how many samples a value may last by chance in a recording.

    Parameters
    ----------
    share : float
        Of the samples that repeat the one before, elsewhere.
    lengths : ndarray of int
        Of the runs there, at least 2.
    count : int
        Samples of the recording.
    """
    if share < REPEATED_SHARE or share > NOISELESS:
        return 0.0
    # Where the effort is flat it repeats itself more often: a third sample tells how often, among the shortest runs.
    two, three = (int(np.sum(lengths == samples)) for samples in (2, 3))
    again = min(max(share, three / two if two else 0.0), NOISELESS)
    # Of `count` samples so many begin a run of L: count share again^(L - 2).
    return float(2.0 + np.log(CHANCE / (count * share)) / np.log(again))


def without_noise(values: Array, live: NDArray[np.bool_]) -> bool:
    """Tell whether what is live of an effort is smooth to its rounding, as a simulator writes it."""
    beside = ORDER + 2
    if len(values) < beside:
        return False
    whole = np.convolve(live, np.ones(beside), "valid") > beside - 0.5
    if not whole.any():
        return False
    lower, higher = (np.abs(np.diff(values, n=order)) for order in (ORDER, ORDER + 1))
    rounding = ROUNDING_STEPS * resolution(values)
    return bool(np.median(higher[whole]) <= max(float(np.median(lower[:-1][whole])), rounding))


def _steady(samples: Samples, first: int, last: int) -> bool:
    """Tell whether all joints keep their speed from one sample to another."""
    time = samples.time[first : last + 1] - samples.time[first]
    small = IDLE_TRAVEL * joint_range(samples.robot)
    for joint, position in enumerate(samples.position[:, first : last + 1]):
        off = np.max(np.abs(position - np.polyval(np.polyfit(time, position, 1), time)))
        # A joint that rests may do so on the edge between two steps of its encoder.
        if off > max(STEADY_SHARE * max(np.ptp(position), small[joint]), 2.0 * resolution(samples.position[joint])):
            return False
    return True


def _piles_up(values: Array, at: NDArray[np.bool_], direction: int) -> bool:
    _, length = runs(at[1:] & at[:-1])
    if not len(length) or length.max() < PILE_RUN:
        return False
    other = values[~at]
    repeated = (values[1:] == values[:-1])[~at[1:] & ~at[:-1]]
    if len(repeated) and np.mean(repeated) > NOISELESS:
        return False
    # The nearest other values and how often each is taken: a few extremes of what is left suffice.
    few = min(len(other), int(at.sum()) * NEXT_VALUES)
    near = np.sort(np.partition(direction * other, few - 1)[:few]) if few else other
    _, counts = np.unique(near, return_counts=True)
    beside = counts[:NEXT_VALUES]
    return bool(len(beside) == 0 or at.sum() > PILE_UP * beside.mean())
