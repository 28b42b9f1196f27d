"""The unit of a column by its numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.recording.audit.clock import MAX_INTERVAL, MIN_INTERVAL, USUAL_INTERVAL
from scara_ident.recording.audit.position import COUNTS, FAST_PERCENTILE, HIGH_PERCENTILE, LOW_PERCENTILE, SPEED_ROWS
from scara_ident.robot.robot import Robot
from scara_ident.robot.units import COUNT, TIME, TURN, table_of

# A log of some samples a second is more usual than one of as many thousands: steps of 0.08 are s, not ms.
UNUSUAL_CLOCK_ODDS = 2e-4
# Positions may lie beyond the limits by this share of the range, and move this many times faster than the limit.
SLACK, HASTE = 0.1, 2.0
# A joint of which nothing is known turns less than this either way, and not faster.
MAX_ANGLE, MAX_JOINT_SPEED = 2 * TURN, 4 * TURN
MAX_SLIDE, MAX_SLIDE_SPEED = 10.0, 10.0
# A recorded velocity is that of the position where it correlates so well with its slope, and fits within this share.
MIN_CORRELATION, SLOPE_TOLERANCE = 0.9, 0.1
# Of a clock that runs at another rate it is another multiple of the slope, alike on all joints within this share.
CLOCK_TOLERANCE = 0.05
# Of a joint this much slower than the fastest one slope and velocity are noise: of its encoder, while it stands still.
SLOWER = 0.02


@dataclass(frozen=True)
class Reading:
    """A unit, and the side of the gear on which an encoder counts."""

    unit: str
    side: str = "joint"


def time_unit(time: Array, said: str | None = None) -> str | None:
    """Return the unit of a clock from its usual step; None where it is no clock.

    Parameters
    ----------
    time : ndarray, shape (N,)
    said : str, optional
        The unit that its name says, which holds where its steps can be such.
    """
    step = np.diff(time[np.isfinite(time)])
    if len(step) < 2 or not np.mean(step > 0) > 0.5 or np.mean(step < 0) > 0.01:
        return None
    median = float(np.median(step[step > 0]))
    fitting = {
        name: unit.factor * median
        for name, unit in TIME.items()
        if MIN_INTERVAL <= unit.factor * median <= MAX_INTERVAL
    }
    if said in fitting:
        return said
    likely = {name: interval for name, interval in fitting.items() if interval > UNUSUAL_CLOCK_ODDS} or fitting
    return min(likely, key=lambda name: abs(np.log(likely[name] / USUAL_INTERVAL))) if likely else None


def position_readings(robot: Robot, joints: list[int], time: Array, position: Array) -> list[Reading]:
    """List the readings of some joints' positions that their limits and speeds allow, the likeliest first.

    Parameters
    ----------
    joints : list of int
        Joints that all turn or all translate.
    time : ndarray, shape (N,)
        In s.
    position : ndarray, shape (k, N)
        As recorded, a row for each of `joints`.
    """
    linear = bool(robot.prismatic[joints[0]])
    table = table_of("position", linear=linear)
    if all(np.ptp(row) > COUNTS and np.array_equal(row, np.rint(row)) for row in position):
        return [Reading(COUNT)]
    readings = []
    for side in ("joint", "motor"):
        gear = robot.reduction[joints] if side == "motor" else np.ones(len(joints))
        if side == "motor" and np.all(gear == 1.0):
            continue
        for name, unit in table.items() if side == "joint" else table_of("position", linear=False).items():
            if name != COUNT and _fit(robot, joints, time, position * (unit.factor / gear)[:, None]):
                readings.append(Reading(name, side))
    return readings


def velocity_reading(slope: Array, velocity: Array, reduction: Array, *, linear: bool) -> Reading | None:
    """Return the unit in which recorded velocities are the slopes of the positions, if there is one.

    Parameters
    ----------
    slope, velocity : ndarray, shape (k, M)
        Slope of the positions in rad/s (m/s), and what was recorded, over the same times; see `averages`.
    reduction : ndarray, shape (k,)
    linear : bool
        Whether the joints translate.
    """
    ratios = _ratios(slope, velocity)
    if ratios is None:
        return None
    moving = _moving(slope)
    for side in ("joint", "motor"):
        gear = reduction[moving] if side == "motor" else np.ones(len(ratios))
        for name, unit in table_of("velocity", linear=linear and side == "joint").items():
            if not name.startswith(COUNT) and np.all(np.abs(ratios * unit.factor / gear - 1) < SLOPE_TOLERANCE):
                return Reading(name, side)
    return None


def one_multiple(slope: Array, velocity: Array) -> bool:
    """Tell whether recorded velocities are one multiple of the slopes of the positions, as of a clock at another rate.

    Parameters
    ----------
    slope, velocity : ndarray, shape (k, M)
        As of `velocity_reading`.
    """
    ratios = _ratios(slope, velocity)
    return ratios is not None and bool(np.all(np.abs(ratios / np.median(ratios) - 1.0) < CLOCK_TOLERANCE))


def _ratios(slope: Array, velocity: Array) -> Array | None:
    """Return recorded velocity per slope of every joint that moves; None where one of them is not its slope."""
    moving = _moving(slope)
    if not moving.any() or not np.isfinite(velocity[moving]).all():
        return None
    ratios = np.empty(int(moving.sum()))
    for k, (known, recorded) in enumerate(zip(slope[moving], velocity[moving], strict=True)):
        if np.std(recorded) == 0 or abs(np.corrcoef(known, recorded)[0, 1]) < MIN_CORRELATION:
            return None
        ratios[k] = float(known @ recorded) / float(known @ known)
    return ratios


def _moving(slope: Array) -> NDArray[np.bool_]:
    speed = np.std(slope, axis=1)
    return np.asarray(speed > SLOWER * np.max(speed, initial=0.0))


def slopes(time: Array, values: Array) -> Array:
    """Return the slope of signals, shape (k, N), over some samples on either side, shape (k, M)."""
    first, last = _windows(time)
    return np.asarray((values[:, last] - values[:, first]) / (time[last] - time[first]))


def averages(time: Array, values: Array) -> Array:
    """Return the mean of signals, shape (k, N), over the times that `slopes` goes over, shape (k, M).

    A slope over many samples is the mean velocity in them: that in their middle is another where the velocity bends.
    """
    first, last = _windows(time)
    areas = 0.5 * (values[:, 1:] + values[:, :-1]) * np.diff(time)
    total = np.concatenate([np.zeros((len(values), 1)), np.cumsum(areas, axis=1)], axis=1)
    return np.asarray((total[:, last] - total[:, first]) / (time[last] - time[first]))


def _windows(time: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return first and last rows of windows of some samples, without those in which time stands still."""
    rows = max(1, min(SPEED_ROWS // 2, len(time) // 8))
    middle = np.arange(rows, len(time) - rows)
    middle = middle[time[middle + rows] > time[middle - rows]]
    return middle - rows, middle + rows


def _fit(robot: Robot, joints: list[int], time: Array, position: Array) -> bool:
    linear = bool(robot.prismatic[joints[0]])
    low, high = np.percentile(position, (LOW_PERCENTILE, HIGH_PERCENTILE), axis=1)
    lower, upper = robot.lower[joints], robot.upper[joints]
    widest = MAX_SLIDE if linear else MAX_ANGLE
    bounded = np.isfinite(upper - lower) & (upper > lower)
    lower, upper = np.where(bounded, lower, -widest), np.where(bounded, upper, widest)
    if bounded.any():
        # Beside joints with limits, which tell the unit, one without may turn on and on.
        low, high = np.where(bounded, low, 0.0), np.where(bounded, high, 0.0)
    slack = SLACK * (upper - lower)
    if np.any(low < lower - slack) or np.any(high > upper + slack):
        return False
    # An angle may be held within one turn.
    whole = position if linear else np.unwrap(position, axis=1)
    speed = np.percentile(np.abs(slopes(time, whole)), FAST_PERCENTILE, axis=1)
    limit = robot.velocity_limit[joints]
    fastest = MAX_SLIDE_SPEED if linear else MAX_JOINT_SPEED
    return bool(np.all(speed <= np.where(np.isfinite(limit), HASTE * limit, fastest)))
