"""The design as an optimisation problem: cost and limits of coefficients, and how both change with them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.excitation.clearance import Nearest
from scara_ident.excitation.criteria import Criterion
from scara_ident.excitation.curves import Basis
from scara_ident.excitation.limits import Limits
from scara_ident.excitation.sensitivity import SmoothModel
from scara_ident.excitation.slopes import Slopes
from scara_ident.excitation.tool import ToolMotion, tool_motion
from scara_ident.motion.motion import Motion

# Coulomb friction turns within this share of the speed that a joint can have, at the start and at the end of a search.
WIDEST, NARROWEST = 0.05, 0.005


@dataclass(frozen=True, eq=False)
class Task:
    """What is to be designed.

    Attributes
    ----------
    smooth : SmoothModel
        The torque model.
    limits : Limits
        Torques are what Coulomb friction leaves of them; see `without_coulomb`.
    nominal : ndarray, shape (p,)
        Parameters of which torques are foreseen, without Coulomb friction.
    bases : tuple of Basis
        Of each of the k trajectories that are designed together.
    posture : ndarray, shape (n,)
        Posture at rest that coefficients of zero give.
    samples : tuple of int
        Samples of each trajectory in the criterion.
    weights : ndarray, shape (n,)
        Weight of every joint's rows: 1 for R_v = identity, else 1 / std of its torque.
    prior : ndarray, shape (p, p)
        Information that there is already.
    """

    smooth: SmoothModel
    limits: Limits
    nominal: Array
    criterion: Criterion
    bases: tuple[Basis, ...]
    posture: Array
    samples: tuple[int, ...]
    weights: Array
    prior: Array

    @property
    def shape(self) -> tuple[int, int, int]:
        """Shape of the coefficients (k, n, m); those beyond the size of a basis move nothing."""
        return self.trajectories, len(self.posture), max(basis.size for basis in self.bases)

    @property
    def trajectories(self) -> int:
        """How many, k, are designed together."""
        return len(self.bases)

    @cached_property
    def speed(self) -> Array:
        """Speed that each joint can have, shape (n,)."""
        return speed_within(self.limits, self.bases)


def speed_within(limits: Limits, bases: Sequence[Basis]) -> Array:
    """Return the speed that each joint can have, shape (n,): its limit, or what its range leaves a motion of the bases' frequencies.

    What has no frequency above f and stays within a of its centre is no faster than 2 pi f a (Bernstein's inequality). Many a
    URDF states a limit that no motion comes near.
    """
    highest = max(basis.bandwidth for basis in bases)
    return np.minimum(limits.velocity, np.pi * highest * (limits.upper - limits.lower))


@dataclass(frozen=True, eq=False)
class Point:
    """A motion with what was evaluated of it.

    Attributes
    ----------
    x : ndarray, shape (k, n, m)
    cost : float
        Infinite where limits are broken.
    values : ndarray, shape (R, k M)
        Rows of limits; only the first ones where these are broken.
    regressor : ndarray, shape (n, p, k M), or None
    near : Nearest or None
        Distances, where they are measured.
    uphill : ndarray, shape (p, p), or None
        Derivative of the cost by the information, where the cost is finite.
    """

    x: Array
    motion: Motion
    cost: float
    values: Array
    regressor: Array | None = None
    tool: ToolMotion | None = None
    near: Nearest | None = None
    uphill: Array | None = None


@dataclass(frozen=True, eq=False)
class Problem:
    """A task on a grid of times.

    Attributes
    ----------
    rows : ndarray, shape (4, k, M, m)
        Bases and their derivatives at the M times of limits and criterion.
    bounds : ndarray, shape (R,)
        Bound of each row of limits, 1 or a little less to make up for what happens between the times.
    sparse : int
        At every sparse-th of them distances are measured; 1 for all pairs of shapes, else for the likely ones.
    """

    task: Task
    rows: Array
    bounds: Array
    sparse: int = 1

    def sharpened(self, share: float) -> Problem:
        """Return the problem as it is to be solved first (share 0) or last (share 1)."""
        task = self.task
        width = WIDEST * (NARROWEST / WIDEST) ** share
        smooth = replace(task.smooth, width=width * task.speed)
        return replace(self, task=replace(task, smooth=smooth, criterion=task.criterion.sharpened(share)))

    @cached_property
    def two_sided(self) -> NDArray[np.bool_]:
        """Which rows are bounded from both sides, shape (R,)."""
        names = row_names(self.task.limits, len(self.task.posture))
        return np.array([joint is not None for _, joint in names])

    def motion(self, x: Array) -> Motion:
        """Return the motion of coefficients (k, n, m): the samples of all trajectories, one after the other."""
        q, v, a = (self._derivative(x, order) for order in range(3))
        q = q + self.task.posture[:, None]
        return Motion("design", "design", np.arange(q.shape[1], dtype=float), q, v, a, None, 1.0)

    def _derivative(self, x: Array, order: int) -> Array:
        return np.asarray(np.einsum("knm,kMm->nkM", x, self.rows[order]).reshape(x.shape[1], -1))

    def at(self, x: Array) -> Point:
        """Evaluate coefficients; where first rows break their bounds, those after them and the cost are left out."""
        motion = self.motion(x)
        values = self._own(x, motion)
        if not self._kept(values):
            return Point(x, motion, np.inf, values)
        found = self._limited(x, motion, values)
        if found.regressor is None or not self._kept(found.values):
            return found
        cost, uphill = self._cost(found.regressor)
        return replace(found, cost=cost, uphill=uphill)

    def whole(self, x: Array) -> Point:
        """Evaluate coefficients with all rows and the cost, whatever limits they break."""
        motion = self.motion(x)
        found = self._limited(x, motion, self._own(x, motion), broken=True)
        assert found.regressor is not None
        cost, uphill = self._cost(found.regressor)
        return replace(found, cost=cost, uphill=uphill)

    def inside(self, x: Array) -> bool:
        """Tell whether all limits are kept, whatever the cost."""
        motion = self.motion(x)
        values = self._own(x, motion)
        return self._kept(values) and self._kept(self._limited(x, motion, values).values)

    def _kept(self, values: Array) -> bool:
        """Whether the first rows are within their bounds."""
        two, bounds = self.two_sided[: len(values), None], self.bounds[: len(values), None]
        return bool(np.all(np.where(two, np.abs(values), values) < bounds))

    def limited(self, x: Array) -> Array:
        """Return all rows of limits (R, k M), broken or not."""
        motion = self.motion(x)
        return self._limited(x, motion, self._own(x, motion), broken=True).values

    def slopes(self, point: Point) -> Slopes:
        """Return cost and limits with their derivatives at a point with all rows."""
        task, motion, regressor = self.task, point.motion, point.regressor
        assert regressor is not None
        k, n = point.x.shape[:2]
        cost, uphill = self._cost(regressor) if point.uphill is None else (point.cost, point.uphill)
        scale = 2.0 * self._share[:, None] * task.weights[:, None, None, None] ** 2
        weights = (scale * (uphill @ regressor).reshape(n, -1, k, motion.samples // k)).reshape(regressor.shape)
        by_motion, torque = task.smooth.derivatives(motion, weights, task.nominal)
        limited = np.isfinite(task.limits.torque)
        dense = [torque[limited] / task.limits.torque[limited, None, None, None]]
        if point.tool is not None:
            dense += [slope[None] for _, slope in tool_rows(task.limits, point.tool, True)]
        if point.near is not None:
            dense.append(self._nearing(motion, point.near))
        by_kind = by_motion.reshape(3, n, k, -1)
        return Slopes(
            cost=cost,
            gradient=np.einsum("dnkM,dkMm->knm", by_kind, self.rows[:3]).reshape(k, -1),
            values=point.values,
            own=self._own_rows,
            shared=self._chained(np.concatenate(dense), k),
            rows=self.rows,
        )

    @property
    def _share(self) -> Array:
        """Samples of the criterion that one sample of the grid stands for, shape (k,)."""
        return np.asarray(np.array(self.task.samples) / self.rows.shape[2])

    @cached_property
    def _own_rows(self) -> tuple[tuple[int, int, float], ...]:
        limits = self.task.limits
        bounds = (0.5 * (limits.upper - limits.lower), limits.velocity, limits.acceleration, limits.jerk)
        return tuple(
            (kind, j, 1.0 / float(x)) for kind, each in enumerate(bounds) for j, x in enumerate(each) if np.isfinite(x)
        )

    def _own(self, x: Array, motion: Motion) -> Array:
        centre = self.task.limits.centre[:, None]
        jerk = self._derivative(x, 3) if np.isfinite(self.task.limits.jerk).any() else motion.a
        signals = (motion.q - centre, motion.v, motion.a, jerk)
        return np.array([scale * signals[kind][j] for kind, j, scale in self._own_rows])

    def _limited(self, x: Array, motion: Motion, own: Array, broken: bool = False) -> Point:
        """Add all other rows; distances, which take longest, only where the rest is kept, or broken rows are wanted too."""
        limits, regressor = self.task.limits, self.task.smooth.regressor(motion)
        torque = np.einsum("jpN,p->jN", regressor, self.task.nominal)
        limited = np.isfinite(limits.torque)
        values = [own, torque[limited] / limits.torque[limited, None]]
        tool, near = None, None
        if limits.tool is not None and limits.watches_tool:
            moving = np.isfinite([limits.tool_acceleration, limits.tool_speed]).any()
            tool = tool_motion(limits.tool, motion.q, *((motion.v, motion.a) if moving else ()))
            values += [row[None] for row, _ in tool_rows(limits, tool, False)]
        rows = np.concatenate(values)
        clearance = limits.clearance
        if clearance is not None and clearance.groups and (broken or self._kept(rows)):
            places = self._measured(motion)
            near = clearance.nearest(motion.q[:, places], clearance.reach, likely=self.sparse > 1)
            distances = np.zeros((len(clearance.groups), motion.samples))
            distances[:, places] = clearance.rows(near, len(places))
            rows = np.concatenate([rows, distances])
        return Point(x, motion, np.inf, rows, regressor, tool, near)

    def _measured(self, motion: Motion) -> NDArray[np.intp]:
        """Return the samples at which distances are measured."""
        return np.arange(motion.samples).reshape(self.task.trajectories, -1)[:, :: self.sparse].ravel()

    def _nearing(self, motion: Motion, near: Nearest) -> Array:
        """Return derivatives of the rows of distances by the motion, shape (G, 3, n, k M)."""
        clearance, places = self.task.limits.clearance, self._measured(motion)
        assert clearance is not None
        slope = np.zeros((len(clearance.groups), 3, *motion.q.shape))
        slope[:, 0][..., places] = clearance.slopes(motion.q[:, places], near)
        return slope

    def _cost(self, regressor: Array) -> tuple[float, Array]:
        rows = regressor * self.task.weights[:, None, None]
        rows = rows.reshape(*rows.shape[:2], self.task.trajectories, -1) * np.sqrt(self._share)[:, None]
        stacked = rows.transpose(1, 0, 2, 3).reshape(rows.shape[1], -1)
        return self.task.criterion.cost(stacked @ stacked.T + self.task.prior)

    def _chained(self, slopes: Array, k: int) -> Array:
        """Chain derivatives of rows by the motion (R', 3, n, k M) with the basis: (R', k, M, n m)."""
        count, _, n, _ = slopes.shape
        parts = slopes.reshape(count, 3, n, k, -1)
        result = np.einsum("rnkM,kMm->rkMnm", parts[:, 0], self.rows[0])
        for kind in (1, 2):
            # Distances and heights, which come last, depend on positions alone.
            some = 1 + np.flatnonzero(np.any(parts[:, kind], axis=(1, 2, 3))).max(initial=-1)
            result[:some] += np.einsum("rnkM,kMm->rkMnm", parts[:some, kind], self.rows[kind])
        return np.asarray(result.reshape(count, k, self.rows.shape[2], -1))


def row_names(limits: Limits, joints: int) -> list[tuple[str, int | None]]:
    """List the rows of limits: what they limit and on which joint, in the order of `Slopes`."""
    names: list[tuple[str, int | None]] = [("position", j) for j in range(joints)]
    names += [("velocity", j) for j in range(joints)]
    names += [("acceleration", j) for j in range(joints) if np.isfinite(limits.acceleration[j])]
    names += [("jerk", j) for j in range(joints) if np.isfinite(limits.jerk[j])]
    names += [("torque", j) for j in range(joints) if np.isfinite(limits.torque[j])]
    if np.isfinite(limits.tool_acceleration):
        names.append(("tool_acceleration", None))
    if np.isfinite(limits.tool_speed):
        names.append(("tool_speed", None))
    if np.isfinite(limits.floor):
        names.append(("tool_height", None))
    if limits.clearance is not None:
        names += [(f"distance_{group}", None) for group in limits.clearance.groups]
    return names


def tool_rows(limits: Limits, tool: ToolMotion, slopes: bool) -> list[tuple[Array, Array]]:
    """Return rows about the tool, each at most 1, with derivatives (3, n, N) if asked for.

    Squares of acceleration and speed stand for their sizes, and 1 - height above the floor in m for height.
    """
    found: list[tuple[Array, Array]] = []
    none: Array = np.zeros(0)
    if np.isfinite(limits.tool_acceleration):
        unit = tool.acceleration / limits.tool_acceleration**2
        slope = none
        if slopes:
            turned = 2.0 * np.einsum("dncN,cN->dnN", tool.jacobians, unit)
            slope = np.array([turned[2], 2.0 * turned[1], turned[0]])
        found.append((np.sum(unit * tool.acceleration, axis=0), slope))
    if np.isfinite(limits.tool_speed):
        unit = tool.velocity / limits.tool_speed**2
        slope = none
        if slopes:
            turned = 2.0 * np.einsum("dncN,cN->dnN", tool.jacobians[:2], unit)
            slope = np.array([turned[1], turned[0], np.zeros_like(turned[0])])
        found.append((np.sum(unit * tool.velocity, axis=0), slope))
    if np.isfinite(limits.floor):
        slope = none
        if slopes:
            slope = np.zeros((3, *tool.jacobians[0, :, 0].shape))
            slope[0] = -tool.jacobians[0, :, 2]
        found.append((1.0 + limits.floor - tool.position[2], slope))
    return found
