"""What a motion really reaches, between the times of the design too."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.excitation.curves import CHUNK, Basis
from scara_ident.excitation.limits import Limits
from scara_ident.excitation.problem import Problem, Task, row_names


@dataclass(frozen=True)
class Reached:
    """A limit and how much of it a motion uses.

    Attributes
    ----------
    name : str
        ``<joint>.position.lower``, ``<joint>.position.upper``, ``<joint>.velocity``, ``<joint>.torque``,
        ``tool.acceleration``, ``tool.speed`` or ``tool.height``.
    bound : float
    reached : float
        The largest value, the smallest of lower bounds and of height; between the samples too.
    unit : str
    share : float
        Of the bound that is used, of a range's half from its middle; above 1 the limit is broken.
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


def grid(basis: Basis, times: int) -> Array:
    """Return the basis and its two derivatives at equally spaced times, shape (3, times, m)."""
    step = basis.duration / times
    # A period closes on itself; otherwise the middles of the intervals, where a sum is a good integral.
    offset = 0.0 if basis.periodic else 0.5 * step
    time: Array = step * np.arange(times, dtype=np.float64) + offset
    return np.array([basis.rows(time, order) for order in range(3)])


def extremes(task: Task, x: Array, times: int) -> tuple[Array, Array]:
    """Return the largest and the smallest value of every row of limits over continuous time.

    Between two samples a function exceeds both by at most ``h^2 / 8`` times its second derivative, which is taken
    from second differences around; the grid must be fine enough for these to be small.

    Parameters
    ----------
    task : Task
    x : ndarray, shape (k, n, m)
    times : int
        Samples per trajectory.

    Returns
    -------
    largest, smallest : ndarray, shape (R,)
    """
    time: Array = np.asarray(np.linspace(0.0, task.basis.duration, times), dtype=np.float64)
    found = []
    for first in range(0, times, CHUNK):
        # With two neighbours on either side, for second differences around every time.
        begin, end = max(0, first - 2), min(times, first + CHUNK + 2)
        high, low = _envelope(task, x, time[begin:end])
        kept = slice(first - begin, min(first + CHUNK, times) - begin)
        found.append((high[..., kept].max(axis=(1, 2)), low[..., kept].min(axis=(1, 2))))
    return np.max([high for high, _ in found], axis=0), np.min([low for _, low in found], axis=0)


def _envelope(task: Task, x: Array, time: Array) -> tuple[Array, Array]:
    """Return what rows may reach around times, from above and from below, shape (R, k, M)."""
    rows = np.array([task.basis.rows(time, order) for order in range(3)])
    values = Problem(task, rows, 1, np.ones(0)).limited(x).reshape(-1, task.trajectories, len(time))
    around = np.zeros_like(values)
    around[..., 1:-1] = np.abs(np.diff(values, n=2, axis=2))
    beyond = np.maximum(around, np.maximum(np.roll(around, 1, axis=2), np.roll(around, -1, axis=2))) / 8.0
    return values + beyond, values - beyond


def reached(task: Task, torque: Array, x: Array, times: int) -> tuple[Reached, ...]:
    """Say for every limit how much of it a motion uses.

    Parameters
    ----------
    task : Task
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
            found.append(_of_tool(limits, kind, float(high)))
            continue
        name, length = robot.joints[joint], robot.position_unit(joint)
        both = float(max(high, -low))
        if kind == "position":
            centre, half = limits.centre[joint], 0.5 * (limits.upper[joint] - limits.lower[joint])
            for side, ends, value in (("lower", limits.lower, -low), ("upper", limits.upper, high)):
                place = centre + (half if side == "upper" else -half) * value
                found.append(Reached(f"{name}.position.{side}", float(ends[joint]), float(place), length, float(value)))
        elif kind == "velocity":
            bound = float(limits.velocity[joint])
            found.append(Reached(f"{name}.velocity", bound, both * bound, f"{length}/s", both))
        else:
            bound, left = float(torque[joint]), float(limits.torque[joint])
            value = bound - left + both * left
            found.append(Reached(f"{name}.torque", bound, value, robot.torque_unit(joint), value / bound))
    return tuple(found)


def _of_tool(limits: Limits, kind: str, value: float) -> Reached:
    if kind == "tool_height":
        return Reached("tool.height", limits.floor, limits.floor + 1.0 - value, "m", value)
    # These rows are squares.
    share = float(np.sqrt(value))
    if kind == "tool_speed":
        return Reached("tool.speed", limits.tool_speed, share * limits.tool_speed, "m/s", share)
    return Reached("tool.acceleration", limits.tool_acceleration, share * limits.tool_acceleration, "m/s^2", share)
