"""Faults of recorded positions: units, turns, spikes, jumps, limits, rest; and numbers that are no measurement at all."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.manners import several
from scara_ident.recording.audit.effort import without_noise
from scara_ident.recording.audit.interpolated import rows_between_corners
from scara_ident.recording.audit.samples import (
    GAP_STEPS,
    IDLE_TRAVEL,
    Checked,
    Finding,
    Samples,
    joint_range,
    speed_limit,
)

if TYPE_CHECKING:
    from scara_ident.robot.robot import Robot

# Positions are judged by these percentiles and speeds by that one, so that a few wild samples decide nothing.
LOW_PERCENTILE, HIGH_PERCENTILE, FAST_PERCENTILE = 2.0, 98.0, 95.0
# Speed is taken over this many samples, in which steps and noise of an encoder average out.
SPEED_ROWS = 20
# Another unit is sought where positions lie beyond the limits by this share of the range (real arms have been seen a
# fifth beyond, degrees lie tens of ranges beyond), or move this many times faster than the arm can ...
POSITION_EXCESS = 1.0
SPEED_EXCESS = 5.0
# ... or where both are seen to a lesser extent.
POSITION_EXCESS_OF_BOTH = 0.1
SPEED_EXCESS_OF_BOTH = 2.0
# Whole numbers over a range this wide are encoder counts: as degrees they would be three turns.
COUNTS = 1000.0
# So many readings are named where several fit, the commonest mistakes first.
GUESSES = 3
# What is left of a step of about one turn, rad, when the turn is taken off; arms do less than this in a sample.
WRAP_REST = 0.5
# A step is wild where it takes this many times the speed of the arm, and is this many times its larger steps and the
# encoder's count; where the arm hardly moves, a tenth of its velocity limit stands in for its speed.
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
# Differences of this order leave nothing of a smooth motion and all of the noise or steps of an encoder, times the root of the
# sum of the squares of their weights.
DIFFERENCES = 10
GAIN = math.sqrt(math.comb(2 * DIFFERENCES, DIFFERENCES))
# Of an encoder of 24 bits before a gear of 160 steps leave 3e-10 of the largest position or more; of computed numbers rounding
# leaves 1e-16, and a motion of 2 Hz at 125 Hz 3e-13.
ROUNDING_SHARE = 1e-11
# So many places in motion tell.
MIN_MOVING_SAMPLES = 100
# The counts of 32 bits end at 4e9; what a broken channel or a wrong type of number gives has up to 300 digits.
LARGEST_SIZE = 1e12


def impossible_sizes(samples: Samples) -> Checked:
    """Leave out single positions and efforts that no encoder, no drive and no unit gives; refuse many."""
    found = []
    keep = np.ones(samples.count, dtype=bool)
    for signal, rows in (("position", samples.position), ("effort", samples.effort)):
        if rows is None or not (wild := np.abs(rows) > LARGEST_SIZE).any():
            continue
        joint = int(np.argmax(wild.sum(axis=1)))
        index, count = int(np.argmax(wild[joint])), int(wild[joint].sum())
        what = f"{samples.robot.joints[joint]}.{signal} is {rows[joint, index]:.3g} in {samples.where(index)}, which is not a possible value"
        if count > max(SPIKE_ROWS, SPIKE_SHARE * samples.count):
            samples.refuse(
                f"{what}, so in {count} of {samples.count} rows; check the type of its numbers and record it again"
            )
        keep &= ~wild.any(axis=0)
        found.append(Finding("spike", f"{what}: {several(int(wild.any(axis=0).sum()), 'row')} left out", count))
    return samples.kept(keep), found


class _Reading(NamedTuple):
    """One way to read a number as a position: position = number * factor + offset."""

    name: str
    factor: float
    offset: float
    remedy: str


def position_unit(samples: Samples) -> Checked:
    """Refuse positions that are not in rad or m, and say what they look like."""
    robot = samples.robot
    low, high = np.percentile(samples.position, (LOW_PERCENTILE, HIGH_PERCENTILE), axis=1)
    speed = _speed(_unwrapped(samples))
    reach = joint_range(robot)
    beyond = np.maximum(robot.lower - low, high - robot.upper) / reach
    bounded = np.isfinite(robot.upper - robot.lower) & (robot.upper > robot.lower)
    beyond = np.where(bounded, beyond, 0.0)
    haste = speed / speed_limit(robot)
    counts = (high - low > COUNTS) & np.array([_whole(values) for values in samples.position])
    suspect = (
        (beyond > POSITION_EXCESS)
        | (haste > SPEED_EXCESS)
        | ((beyond > POSITION_EXCESS_OF_BOTH) & (haste > SPEED_EXCESS_OF_BOTH))
        | counts
    )
    if not suspect.any():
        return samples, []

    joint = int(np.argmax(suspect))
    values, name = samples.position[joint], robot.position_unit(joint)
    if beyond[joint] > 0:
        under = robot.lower[joint] - low[joint] > high[joint] - robot.upper[joint]
        index = int(np.argmin(values) if under else np.argmax(values))
        bounds = f"{robot.lower[joint]:.4g} to {robot.upper[joint]:.4g} {name}"
        seen = f"reaches {values[index]:.4g} in {samples.where(index)}, limits {bounds}"
    elif haste[joint] > SPEED_EXCESS:
        seen = f"moves at {speed[joint]:.4g} a second, limit {robot.velocity_limit[joint]:.4g} {name}/s"
    else:
        seen = f"runs from {low[joint]:.6g} to {high[joint]:.6g} in whole numbers"
    if counts[joint]:
        full = "the travel of a count" if robot.prismatic[joint] else "2 pi / counts of a joint turn"
        guess = f"it looks like encoder counts (multiply by {full})"
    else:
        readings = _readings(robot, joint, low[joint], high[joint])
        fitting = [r for r in readings if _fits(r, robot, joint, low[joint], high[joint], speed[joint])]
        looks = " or ".join(f"{reading.name} ({reading.remedy})" for reading in fitting[:GUESSES])
        guess = f"it looks like {looks}" if fitting else "its unit is not known to the audit"
        ungeared = abs(robot.reduction[joint]) == 1.0 and not robot.prismatic[joint]
        if ungeared and (not fitting or fitting[0].name == "degrees"):
            guess += ", or it is the motor's angle (state reduction, and side: motor of position, in robot.yaml)"
    others = [f"{robot.joints[k]}.position" for k in np.flatnonzero(suspect)[1:]]
    also = f" (and {', '.join(others)})" if others else ""
    # What would be within its limits about another zero.
    shifted = beyond[joint] > 0.0 and high[joint] - low[joint] <= reach[joint] and haste[joint] <= 1.0
    zero = ", or add an offset to it in robot.yaml if its zero differs" if shifted else ""
    samples.refuse(
        f"{robot.joints[joint]}.position{also} {seen}: {guess}; convert it to {name}, "
        f"or correct the limits in {robot.urdf.name} if they are wrong{zero}"
    )


def whole_turns(samples: Samples) -> Checked:
    """Take out the jumps of an angle that is recorded within one turn."""
    step, lasting = np.diff(samples.position, axis=1), np.diff(samples.time)
    # Over a gap an arm may well turn once, unless it is too slow to turn by half: then it went the shorter way.
    farthest = speed_limit(samples.robot)[:, None] * lasting
    near = lasting < GAP_STEPS * samples.interval
    wrapped = (np.abs(step) > np.pi) & (near | (farthest < np.pi)) & ~samples.robot.prismatic[:, None]
    if not wrapped.any():
        return samples, []
    turns = np.where(wrapped, np.sign(step), 0.0)
    turns[np.abs(step - 2 * np.pi * turns) > np.where(near, WRAP_REST, farthest)] = 0.0
    found = []
    for joint in np.flatnonzero(turns.any(axis=1)).tolist():
        first = int(np.argmax(turns[joint] != 0)) + 1
        count = int(np.count_nonzero(turns[joint]))
        said = (
            f"{samples.robot.joints[joint]}.position jumps by a whole turn {several(count, 'time')}, "
            f"first in {samples.where(first)}: unwrapped"
        )
        found.append(Finding("wrapped", said, count, joint=samples.robot.joints[joint]))
    if not found:
        return samples, []
    position = samples.position.copy()
    position[:, 1:] -= 2 * np.pi * np.cumsum(turns, axis=1)
    return replace(samples, position=position), found


def spikes(samples: Samples) -> Checked:
    """Leave out single wild positions; refuse many, and positions that jump and stay."""
    bound = _wild_step(samples, _fastest(samples))
    step = np.abs(np.diff(samples.position, axis=1))
    suspect = np.flatnonzero((step > bound).any(axis=1))
    if not len(suspect):
        return samples, []
    spiked = np.zeros(samples.position.shape, dtype=bool)
    for joint in suspect.tolist():
        spiked[joint] = _stands_out(samples.position[joint], step[joint] > bound[joint], bound[joint])
    wild = np.asarray(spiked.any(axis=0))
    total = int(wild.sum())
    found = []
    if total:
        joint = int(np.argmax(spiked.sum(axis=1)))
        column = f"{samples.robot.joints[joint]}.position"
        first = int(np.argmax(spiked[joint]))
        what = (
            f"{column} has {several(int(spiked[joint].sum()), 'wild sample')} "
            f"(away and back in one step, {WILD:g} times faster than it moves), first in {samples.where(first)}"
        )
        if total > max(SPIKE_ROWS, SPIKE_SHARE * samples.count):
            samples.refuse(f"{what}: too many of {samples.count} to leave out; check the encoder and its cable")
        found.append(Finding("spike", f"{what}: {several(total, 'row')} left out", total))
    clean = samples.kept(~wild)
    _refuse_jump(clean)
    return clean, found


def idle_joints(samples: Samples) -> Checked:
    """Say which joints stand still."""
    idle = samples.idle()
    if not idle.any():
        return samples, []
    which = np.flatnonzero(idle)
    travel = float(np.max(np.ptp(samples.position[which], axis=1)))
    small = f"(travel at most {travel:.2g} {samples.robot.position_unit(int(which[0]))})"
    if idle.all() and len(which) > 1:
        said = f"no joint moves {small}: only gravity and offsets can be identified"
        return samples, [Finding("idle_joint", said, len(which), idle=tuple(which.tolist()))]
    names = ", ".join(samples.robot.joints[k] for k in which)
    verb, their = ("does", "its") if len(which) == 1 else ("do", "their")
    said = f"{names} {verb} not move {small}: {their} motion is not identified"
    return samples, [Finding("idle_joint", said, len(which), idle=tuple(which.tolist()))]


def limits(samples: Samples) -> Checked:
    """Say which positions lie outside the limits of the URDF."""
    robot = samples.robot
    low, high = samples.position.min(axis=1), samples.position.max(axis=1)
    bounded = np.isfinite(robot.upper - robot.lower) & (robot.upper > robot.lower)
    found = []
    for joint in np.flatnonzero(bounded).tolist():
        under, over = robot.lower[joint] - low[joint], high[joint] - robot.upper[joint]
        if max(under, over) <= OVERSHOOT * (robot.upper[joint] - robot.lower[joint]):
            continue
        values = samples.position[joint]
        index = int(np.argmin(values) if under > over else np.argmax(values))
        limit = robot.lower[joint] if under > over else robot.upper[joint]
        count = int(np.count_nonzero((values < robot.lower[joint]) | (values > robot.upper[joint])))
        said = (
            f"{robot.joints[joint]}.position reaches {values[index]:.4g} {robot.position_unit(joint)} in "
            f"{samples.where(index)}, beyond the URDF's limit of {limit:.4g}: used as it is"
        )
        found.append(Finding("limits", said, count, joint=robot.joints[joint]))
    return samples, found


def computed(samples: Samples) -> Checked:
    """Say where positions beside efforts are no measurement: a simulator's, or what an arm was commanded to do."""
    moving = ~samples.idle()
    if samples.effort is None or not moving.any() or not all(map(is_computed, samples.position[moving])):
        return samples, []
    if all(map(rows_between_corners, samples.position[moving])):
        # Between few samples nothing tells of their noise.
        return samples, []
    # Of a simulator that has no noise at all nobody takes them for measured.
    if any(without_noise(row, np.ones(samples.count, dtype=bool)) for row in samples.effort[moving]):
        return samples, []
    said = (
        "positions have neither noise nor an encoder's steps, as a simulator gives them: if this is a real arm they "
        "are its setpoints, and the lag of its controller looks like friction that builds up or an elastic gear; log "
        "the measured positions"
    )
    return samples, [Finding("computed_position", said, int(np.count_nonzero(moving)))]


def is_computed(position: Array) -> bool:
    """Tell whether a position in motion, shape (N,), is smooth to far less than any encoder resolves."""
    if len(position) <= DIFFERENCES + MIN_MOVING_SAMPLES:
        return False
    moving = np.convolve(np.diff(position) != 0.0, np.ones(DIFFERENCES), "valid") > DIFFERENCES - 0.5
    if np.count_nonzero(moving) < MIN_MOVING_SAMPLES:
        return False
    noise = float(np.median(np.abs(np.diff(position, n=DIFFERENCES)[moving]))) / GAIN
    return noise <= ROUNDING_SHARE * float(np.max(np.abs(position)))


def _speed(samples: Samples) -> Array:
    """Peak speed of each joint, robust against noise and wild samples, shape (n,)."""
    rows = min(SPEED_ROWS, samples.count // 4)
    lasting = np.maximum(samples.time[rows:] - samples.time[:-rows], samples.interval)
    speed: Array = np.percentile(
        np.abs(samples.position[:, rows:] - samples.position[:, :-rows]) / lasting, FAST_PERCENTILE, axis=1
    )
    return speed


def _unwrapped(samples: Samples) -> Samples:
    """Return angles without jumps of about a turn, which are no speed; what is in another unit keeps its own."""
    turning = ~samples.robot.prismatic
    if not (np.abs(np.diff(samples.position[turning], axis=1)) > np.pi).any():
        return samples
    position = samples.position.copy()
    position[turning] = np.unwrap(position[turning], axis=1)
    return replace(samples, position=position)


def _whole(values: Array) -> bool:
    return bool(values[0] == np.rint(values[0])) and bool(np.array_equal(values, np.rint(values)))


def _readings(robot: Robot, joint: int, low: float, high: float) -> list[_Reading]:
    """List how else the numbers of a joint may be meant, the commonest mistakes first."""
    reduction = float(robot.reduction[joint])
    degree = np.pi / 180
    readings = []
    if robot.prismatic[joint]:
        readings.append(_Reading("millimetres", 1e-3, 0.0, "divide by 1000"))
    else:
        bounded = np.isfinite(robot.lower[joint]) and np.isfinite(robot.upper[joint])
        away = (robot.lower[joint] + robot.upper[joint] - low - high) / 2 if bounded else 0.0
        turns = round(away / (2 * np.pi))
        if turns:
            remedy = f"{'add' if turns > 0 else 'subtract'} {abs(turns)} x 2 pi"
            readings.append(_Reading("an angle that is whole turns off", 1.0, 2 * np.pi * turns, remedy))
        readings.append(_Reading("degrees", degree, 0.0, "multiply by pi/180"))
    if abs(reduction) != 1.0:
        divide = f"divide by the reduction {reduction:g}"
        angles = (
            ("angle", 1.0, ""),
            ("turns", 2 * np.pi, "multiply by 2 pi, "),
            ("degrees", degree, "multiply by pi/180, "),
        )
        for kind, factor, multiply in angles:
            readings.append(_Reading(f"the motor's {kind}", factor / reduction, 0.0, multiply + divide))
    return readings


def _fits(reading: _Reading, robot: Robot, joint: int, low: float, high: float, speed: float) -> bool:
    ends = np.array([low, high]) * reading.factor + reading.offset
    slack = POSITION_EXCESS_OF_BOTH * joint_range(robot)[joint]
    return bool(
        ends.min() >= robot.lower[joint] - slack
        and ends.max() <= robot.upper[joint] + slack
        and speed * abs(reading.factor) <= SPEED_EXCESS_OF_BOTH * speed_limit(robot)[joint]
    )


def _wild_step(samples: Samples, fastest: Array) -> Array:
    """Size of a step that an arm of `fastest` speeds (n,) does not make, shape (n, N - 1)."""
    step = np.abs(np.diff(samples.position, axis=1))
    large = np.percentile(step, LARGE_STEP, axis=1)
    count = np.min(step, axis=1, where=step > 0, initial=np.inf)
    small = np.maximum(large, np.where(np.isfinite(count), count, 0.0))
    # A burst of late samples has short steps in time, but the arm had the usual time to move.
    lasting = np.maximum(np.diff(samples.time), samples.interval)
    floor = np.maximum(WILD * small, IDLE_TRAVEL * joint_range(samples.robot))
    bound: Array = np.maximum(WILD * fastest[:, None] * lasting, floor[:, None])
    return bound


def _fastest(samples: Samples) -> Array:
    """Speed of each joint in this recording, (n,), but no more than its limit and no less than a tenth of that."""
    limit = speed_limit(samples.robot)
    speed = _speed(samples)
    return np.where(np.isfinite(limit), np.clip(speed, limit / WILD, limit), speed)


def _stands_out(values: Array, wild: NDArray[np.bool_], bound: Array) -> NDArray[np.bool_]:
    """Tell which samples lie further from their neighbours' median than the arm can go in a step."""
    near = np.unique(np.flatnonzero(wild)[:, None] + np.arange(-1, 3))
    near = near[(near >= 0) & (near < len(values))]
    first = np.clip(near - MEDIAN_ROWS // 2, 0, len(values) - MEDIAN_ROWS)
    away = np.abs(values[near] - np.median(values[first[:, None] + np.arange(MEDIAN_ROWS)], axis=1))
    out = np.zeros(len(values), dtype=bool)
    out[near] = away > bound[np.minimum(near, len(bound) - 1)]
    return out


def _refuse_jump(samples: Samples) -> None:
    step = np.abs(np.diff(samples.position, axis=1))
    # Of a joint without a velocity limit nobody can say what it may not do.
    jump = step > _wild_step(samples, speed_limit(samples.robot))
    if not jump.any():
        return
    joint = int(np.argmax(jump.any(axis=1)))
    index = int(np.argmax(jump[joint])) + 1
    column = f"{samples.robot.joints[joint]}.position"
    samples.refuse(
        f"{column} jumps by {step[joint, index - 1]:.3g} {samples.robot.position_unit(joint)} in {samples.where(index)} and "
        "stays, as after a reset of the encoder; cut the file there"
    )
