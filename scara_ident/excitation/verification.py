"""What a motion reaches of its limits, between the times of the design too."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.excitation.clearance import WATCHED_DISTANCE
from scara_ident.excitation.curves import CHUNK, Basis
from scara_ident.excitation.limits import Limits
from scara_ident.excitation.problem import Problem, Task, row_names

PER_SECOND = {"velocity": "s", "acceleration": "s^2", "jerk": "s^3"}


@dataclass(frozen=True)
class Reached:
    """A limit and how much of it a motion uses.

    Attributes
    ----------
    name : str
        ``<joint>.position.lower``, ``<joint>.position.upper``, ``<joint>.velocity``, ``<joint>.acceleration``,
        ``<joint>.jerk``, ``<joint>.torque``, ``tool.acceleration``, ``tool.speed``, ``tool.height``, or
        ``distance.self``, ``distance.floor``, ``distance.box1``, ....
    reached : float
        The largest value, the smallest of lower bounds, of height and of distances; between the samples too.
    share : float
        Of the bound that is used, of a range's half from its middle; above 1 the limit is broken. Of height and
        distances 1 at the bound and less with what room there is beyond it.
    """

    name: str
    bound: float
    reached: float
    unit: str
    share: float

    @property
    def kept(self) -> bool:
        """Whether the limit holds."""
        return self.share <= 1.0

    @property
    def active(self) -> bool:
        """Whether the limit holds the motion back."""
        return self.share > 0.99


def rows_at(bases: Sequence[Basis], shares: Array) -> Array:
    """Return bases and their three derivatives at shares (M,) of their durations, shape (4, k, M, m), padded by zeros."""
    rows = np.zeros((4, len(bases), len(shares), max(basis.size for basis in bases)))
    for k, basis in enumerate(bases):
        for order in range(4):
            rows[order, k, :, : basis.size] = basis.rows(basis.duration * shares, order)
    return rows


def grid(bases: Sequence[Basis], times: int) -> Array:
    """Return bases and their three derivatives at equally spaced times, shape (4, k, times, m)."""
    # A period closes on itself; otherwise the middles of the intervals, where a sum is a good integral.
    offset = 0.0 if bases[0].periodic else 0.5
    return rows_at(bases, (np.arange(times, dtype=np.float64) + offset) / times)


def extremes(task: Task, x: Array, times: int) -> tuple[Array, Array]:
    """Return the largest and the smallest value of every row of limits over continuous time.

    Between two samples a function exceeds both by at most ``h^2 / 8`` times its second derivative, which is taken
    from second differences around; the grid must be fine enough for these to be small.

    Parameters
    ----------
    x : ndarray, shape (k, n, m)
    times : int
        Samples per trajectory.

    Returns
    -------
    largest, smallest : ndarray, shape (R,)
    """
    shares: Array = np.asarray(np.linspace(0.0, 1.0, times), dtype=np.float64)
    found = []
    for first in range(0, times, CHUNK):
        # With two neighbours on either side, for second differences around every time.
        begin, end = max(0, first - 2), min(times, first + CHUNK + 2)
        high, low = _envelope(task, x, shares[begin:end])
        kept = slice(first - begin, min(first + CHUNK, times) - begin)
        found.append((high[..., kept].max(axis=(1, 2)), low[..., kept].min(axis=(1, 2))))
    return np.max([high for high, _ in found], axis=0), np.min([low for _, low in found], axis=0)


def _envelope(task: Task, x: Array, shares: Array) -> tuple[Array, Array]:
    """Return what rows may reach around shares of the durations, from above and from below, shape (R, k, M)."""
    problem = Problem(task, rows_at(task.bases, shares), np.ones(0))
    values = problem.limited(x).reshape(-1, task.trajectories, len(shares))
    around = np.zeros_like(values)
    around[..., 1:-1] = np.abs(np.diff(values, n=2, axis=2))
    beyond = np.maximum(around, np.maximum(np.roll(around, 1, axis=2), np.roll(around, -1, axis=2))) / 8.0
    return values + beyond, values - beyond


def reached(task: Task, torque: Array, x: Array, times: int) -> tuple[Reached, ...]:
    """Say for every limit how much of it a motion uses.

    Parameters
    ----------
    torque : ndarray, shape (n,)
        Torque limits before Coulomb friction was taken off.
    x : ndarray, shape (k, n, m)
    times : int
        Samples per trajectory.
    """
    limits, robot = task.limits, task.smooth.model.robot
    largest, smallest = extremes(task, x, times)
    found = []
    for (kind, joint), high, low in zip(row_names(limits, robot.n), largest, smallest, strict=True):
        if joint is None:
            if kind.startswith("distance"):
                found.append(_of_distance(task, x, kind.removeprefix("distance_"), float(high), times))
            else:
                found.append(_of_tool(limits, kind, float(high)))
            continue
        name, length = robot.joints[joint], robot.position_unit(joint)
        both = float(max(high, -low))
        if kind == "position":
            centre, half = limits.centre[joint], 0.5 * (limits.upper[joint] - limits.lower[joint])
            for side, ends, value in (("lower", limits.lower, -low), ("upper", limits.upper, high)):
                place = centre + (half if side == "upper" else -half) * value
                found.append(Reached(f"{name}.position.{side}", float(ends[joint]), float(place), length, float(value)))
        elif kind != "torque":
            bound = float(getattr(limits, kind)[joint])
            found.append(Reached(f"{name}.{kind}", bound, both * bound, f"{length}/{PER_SECOND[kind]}", both))
        else:
            bound, left = float(torque[joint]), float(limits.torque[joint])
            value = bound - left + both * left
            found.append(Reached(f"{name}.torque", bound, value, robot.torque_unit(joint), value / bound))
    return tuple(found)


def _of_distance(task: Task, x: Array, group: str, value: float, times: int) -> Reached:
    clearance = task.limits.clearance
    assert clearance is not None
    least = np.inf
    for shares in np.array_split(np.linspace(0.0, 1.0, times), -(-times // CHUNK)):
        motion = Problem(task, rows_at(task.bases, shares), np.ones(0)).motion(x)
        least = min(least, clearance.smallest(motion.q, group))
    share = value if value > 1.0 else max(0.0, 1.0 - (least - clearance.margin) / WATCHED_DISTANCE)
    return Reached(f"distance.{group}", clearance.margin, least, "m", share)


def _of_tool(limits: Limits, kind: str, value: float) -> Reached:
    if kind == "tool_height":
        return Reached("tool.height", limits.floor, limits.floor + 1.0 - value, "m", value)
    # These rows are squares.
    share = float(np.sqrt(value))
    if kind == "tool_speed":
        return Reached("tool.speed", limits.tool_speed, share * limits.tool_speed, "m/s", share)
    return Reached("tool.acceleration", limits.tool_acceleration, share * limits.tool_acceleration, "m/s^2", share)
