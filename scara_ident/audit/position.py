"""Faults of recorded positions: units, whole turns, spikes, jumps, limits, joints that stand still."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from scara_ident.audit.samples import Array, Finding, Samples, joint_range, speed_limit, unit
from scara_ident.robot import Robot

Checked = tuple[Samples, list[Finding]]

# Positions are judged by these percentiles and speeds by that one, so that a few wild samples decide nothing.
LOW, HIGH, FAST = 2.0, 98.0, 95.0
# Speed is taken over this many samples, in which steps and noise of an encoder average out.
SPEED_ROWS = 20
# Another unit is sought where positions lie beyond the limits by this share of the range (real arms have been seen a
# fifth beyond, degrees lie tens of ranges beyond), or move this many times faster than the arm can ...
FAR_OUT = 1.0
TOO_FAST = 5.0
# ... or where both are seen to a lesser extent.
OUT = 0.1
FAST_TOO = 2.0
# Whole numbers over a range this wide are encoder counts: as degrees they would be three turns.
COUNTS = 1000.0
# What is left of a step of about one turn, rad, when the turn is taken off; arms do less than this in a sample.
WRAP_REST = 0.5
# A step is wild where it takes this many times the fastest the arm can go, and this many times its larger steps.
WILD = 10.0
# The larger steps: this percentile of all.
LARGE_STEP = 90.0
# A wild sample returns: it lies far from the median of this many samples around it.
MEDIAN_ROWS = 5
# More wild samples than this share (or this many in a short file) are not scattered.
SPIKE_SHARE = 0.01
SPIKE_ROWS = 5
# Overshoot of the limits up to this share of the range is tracking error, not worth a line.
OVERSHOOT = 0.005


class _Reading(NamedTuple):
    """One way to read a number as a position: position = number * factor + offset."""

    name: str
    factor: float
    offset: float
    remedy: str


def position_unit(samples: Samples) -> Checked:
    """Refuse positions that are not in rad or m, and say what they look like."""
    robot = samples.robot
    low, high = np.percentile(samples.position, (LOW, HIGH), axis=1)
    speed = _speed(samples)
    reach = joint_range(robot)
    beyond = np.maximum(robot.lower - low, high - robot.upper) / reach
    bounded = np.isfinite(robot.upper - robot.lower) & (robot.upper > robot.lower)
    beyond = np.where(bounded, beyond, 0.0)
    haste = speed / speed_limit(robot)
    counts = (high - low > COUNTS) & np.array([_whole(values) for values in samples.position])
    suspect = (beyond > FAR_OUT) | (haste > TOO_FAST) | ((beyond > OUT) & (haste > FAST_TOO)) | counts
    if not suspect.any():
        return samples, []

    joint = int(np.argmax(suspect))
    column = f"{robot.joints[joint]}.position"
    others = [f"{name}.position" for name, here in zip(robot.joints, suspect, strict=True) if here][1:]
    also = f" (and {', '.join(others)})" if others else ""
    if beyond[joint] > 0:
        far = samples.position[joint]
        index = int(
            np.argmin(far) if robot.lower[joint] - low[joint] > high[joint] - robot.upper[joint] else np.argmax(far)
        )
        seen = (
            f"reaches {far[index]:.4g} in {samples.where(index)}, limits {robot.lower[joint]:.4g} to "
            f"{robot.upper[joint]:.4g} {unit(robot, joint)}"
        )
    elif haste[joint] > TOO_FAST:
        limit = f"{robot.velocity_limit[joint]:.4g} {unit(robot, joint)}/s"
        seen = f"moves at {speed[joint]:.4g} a second, limit {limit}"
    else:
        seen = f"runs from {low[joint]:.6g} to {high[joint]:.6g} in whole numbers"
    if counts[joint]:
        guess = f"it looks like encoder counts, multiply by {'2 pi' if not robot.prismatic[joint] else 'metres'} / counts per {'joint turn' if not robot.prismatic[joint] else 'travel'}"
    else:
        fitting = [
            r for r in _readings(robot, joint, low[joint], high[joint]) if _fits(r, robot, joint, low, high, speed)
        ]
        fitting.sort(key=lambda reading: -abs(reading.factor))
        if fitting:
            guess = "it looks like " + " or ".join(f"{r.name} ({r.remedy})" for r in fitting[:2])
        else:
            guess = "it is no unit the audit knows"
    samples.refuse(
        f"{column}{also} {seen}: {guess}; convert it to {unit(robot, joint)}, "
        f"or correct the limits in {robot.urdf.name} if they are wrong"
    )


def whole_turns(samples: Samples) -> Checked:
    """Take out the jumps of an angle that is recorded within one turn."""
    step = np.diff(samples.position, axis=1)
    wrapped = (np.abs(step) > np.pi) & ~samples.robot.prismatic[:, None]
    if not wrapped.any():
        return samples, []
    turns = np.where(wrapped, np.rint(step / (2 * np.pi)), 0.0)
    turns[np.abs(step - 2 * np.pi * turns) > WRAP_REST] = 0.0
    found = []
    for joint in np.flatnonzero(turns.any(axis=1)):
        first = int(np.argmax(turns[joint] != 0)) + 1
        count = int(np.count_nonzero(turns[joint]))
        said = (
            f"{samples.robot.joints[joint]}.position jumps by a whole turn {count} time{'s' if count > 1 else ''}, "
            f"first in {samples.where(first)}: unwrapped"
        )
        found.append(Finding("wrapped", said, count))
    if not found:
        return samples, []
    position = samples.position.copy()
    position[:, 1:] -= 2 * np.pi * np.cumsum(turns, axis=1)
    return (
        Samples(samples.source, samples.robot, samples.time, position, samples.effort, samples.row),
        found,
    )


def spikes(samples: Samples) -> Checked:
    """Leave out single wild positions; refuse many, and positions that jump and stay."""
    bound = _wild_step(samples)
    step = np.abs(np.diff(samples.position, axis=1))
    suspect = np.flatnonzero((step > bound).any(axis=1))
    if not len(suspect):
        return samples, []
    spiked = np.zeros(samples.position.shape, dtype=bool)
    for joint in suspect:
        spiked[joint] = _stands_out(samples.position[joint], step[joint] > bound[joint], bound[joint])
    wild = spiked.any(axis=0)
    total = int(wild.sum())
    found = []
    if total:
        joint = int(np.argmax(spiked.sum(axis=1)))
        column = f"{samples.robot.joints[joint]}.position"
        first = int(np.argmax(spiked[joint]))
        what = (
            f"{column} has {int(spiked[joint].sum())} wild sample{'s' if spiked[joint].sum() > 1 else ''} "
            f"(faster than {WILD:g} times what the arm can do, and back), first in {samples.where(first)}"
        )
        if total > max(SPIKE_ROWS, SPIKE_SHARE * samples.count):
            samples.refuse(f"{what}: too many of {samples.count} to leave out; check the encoder and its cable")
        found.append(Finding("spike", f"{what}: {total} row{'s' if total > 1 else ''} left out", total))
    clean = samples.kept(~wild)
    _refuse_jump(clean)
    return clean, found


def idle_joints(samples: Samples) -> Checked:
    """Say which joints stand still."""
    idle = samples.idle()
    if not idle.any():
        return samples, []
    names = [name for name, here in zip(samples.robot.joints, idle, strict=True) if here]
    travel = float(np.max(np.ptp(samples.position[idle], axis=1)))
    said = (
        f"{', '.join(names)} {'do' if len(names) > 1 else 'does'} not move (travel at most {travel:.2g} "
        f"{unit(samples.robot, int(np.argmax(idle)))}): nothing is learnt of {'their' if len(names) > 1 else 'its'} motion"
    )
    return samples, [Finding("idle_joint", said, len(names))]


def limits(samples: Samples) -> Checked:
    """Say which positions lie outside the limits of the URDF."""
    robot = samples.robot
    low, high = samples.position.min(axis=1), samples.position.max(axis=1)
    bounded = np.isfinite(robot.upper - robot.lower) & (robot.upper > robot.lower)
    found = []
    for joint in np.flatnonzero(bounded):
        under, over = robot.lower[joint] - low[joint], high[joint] - robot.upper[joint]
        if max(under, over) <= OVERSHOOT * (robot.upper[joint] - robot.lower[joint]):
            continue
        values = samples.position[joint]
        index, limit = (
            (int(np.argmin(values)), robot.lower[joint])
            if under > over
            else (int(np.argmax(values)), robot.upper[joint])
        )
        count = int(np.count_nonzero((values < robot.lower[joint]) | (values > robot.upper[joint])))
        said = (
            f"{robot.joints[joint]}.position reaches {values[index]:.4g} {unit(robot, joint)} in {samples.where(index)}, "
            f"beyond the URDF's limit of {limit:.4g}: used as it is"
        )
        found.append(Finding("limits", said, count))
    return samples, found


def _speed(samples: Samples) -> Array:
    """Peak speed of each joint, robust against noise and wild samples, shape (n,)."""
    rows = min(SPEED_ROWS, samples.count // 4)
    lasting = samples.time[rows:] - samples.time[:-rows]
    speed: Array = np.percentile(
        np.abs(samples.position[:, rows:] - samples.position[:, :-rows]) / lasting, FAST, axis=1
    )
    return speed


def _whole(values: Array) -> bool:
    return bool(values[0] == np.rint(values[0])) and bool(np.array_equal(values, np.rint(values)))


def _readings(robot: Robot, joint: int, low: float, high: float) -> list[_Reading]:
    reduction = float(robot.reduction[joint])
    degree = np.pi / 180
    if robot.prismatic[joint]:
        readings = [_Reading("millimetres", 1e-3, 0.0, "divide by 1000")]
    else:
        readings = [_Reading("degrees", degree, 0.0, "multiply by pi/180")]
        turns = (
            round(((robot.lower[joint] + robot.upper[joint]) - (low + high)) / (4 * np.pi))
            if np.isfinite(robot.lower[joint] + robot.upper[joint])
            else 0
        )
        if turns:
            remedy = f"{'add' if turns > 0 else 'subtract'} {abs(turns)} x 2 pi"
            readings.append(_Reading("an angle that is whole turns off", 1.0, 2 * np.pi * turns, remedy))
    if abs(reduction) != 1.0:
        readings.append(_Reading("the motor's angle", 1 / reduction, 0.0, f"divide by the reduction {reduction:g}"))
        readings.append(
            _Reading(
                "the motor's angle in degrees", degree / reduction, 0.0, f"multiply by pi/180, divide by {reduction:g}"
            )
        )
        readings.append(
            _Reading("motor turns", 2 * np.pi / reduction, 0.0, f"multiply by 2 pi, divide by {reduction:g}")
        )
    return readings


def _fits(reading: _Reading, robot: Robot, joint: int, low: Array, high: Array, speed: Array) -> bool:
    ends = np.array([low[joint], high[joint]]) * reading.factor + reading.offset
    slack = OUT * joint_range(robot)[joint]
    return bool(
        ends.min() >= robot.lower[joint] - slack
        and ends.max() <= robot.upper[joint] + slack
        and speed[joint] * abs(reading.factor) <= FAST_TOO * speed_limit(robot)[joint]
    )


def _wild_step(samples: Samples) -> Array:
    """Size of a step that no arm makes, shape (n, 1) or (n, N - 1)."""
    step = np.abs(np.diff(samples.position, axis=1))
    large = np.percentile(step, LARGE_STEP, axis=1)
    # A burst of late samples has short steps in time, but the arm had the usual time to move.
    lasting = np.maximum(np.diff(samples.time), samples.interval)
    limit = speed_limit(samples.robot)
    # Without a limit the arm's own speed stands in for it; a joint that rests then has no bound.
    limit = np.where(np.isfinite(limit), limit, _speed(samples))
    limit[limit == 0] = np.inf
    bound: Array = WILD * np.maximum(limit[:, None] * lasting, large[:, None])
    return bound


def _stands_out(values: Array, wild: NDArray[np.bool_], bound: Array) -> NDArray[np.bool_]:
    """Tell which samples lie further from their neighbours' median than the arm can go in a step."""
    half = MEDIAN_ROWS // 2
    near = np.unique(np.flatnonzero(wild)[:, None] + np.arange(-1, 3))
    near = near[(near >= 0) & (near < len(values))]
    window = np.clip(near[:, None] + np.arange(-half, half + 1), 0, len(values) - 1)
    away = np.abs(values[near] - np.median(values[window], axis=1))
    out = np.zeros(len(values), dtype=bool)
    out[near] = away > bound[np.minimum(near, len(bound) - 1)]
    return out


def _refuse_jump(samples: Samples) -> None:
    step = np.abs(np.diff(samples.position, axis=1))
    bound = _wild_step(samples)
    known = np.isfinite(speed_limit(samples.robot))
    jump = (step > bound) & known[:, None]
    if not jump.any():
        return
    joint = int(np.argmax(jump.any(axis=1)))
    index = int(np.argmax(jump[joint])) + 1
    column = f"{samples.robot.joints[joint]}.position"
    samples.refuse(
        f"{column} jumps by {step[joint, index - 1]:.3g} {unit(samples.robot, joint)} in {samples.where(index)} and "
        "stays, as after a reset of the encoder; cut the file there"
    )
