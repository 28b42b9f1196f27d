"""The design as an optimisation problem: cost and limits of coefficients, and how both change with them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.excitation.criteria import Criterion
from scara_ident.excitation.curves import Basis
from scara_ident.excitation.limits import Limits
from scara_ident.excitation.sensitivity import SmoothModel
from scara_ident.excitation.tool import ToolMotion, tool_motion
from scara_ident.motion.motion import Motion

# Coulomb friction turns within this share of a joint's velocity limit, at the start and at the end of a search.
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
    criterion : Criterion
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


@dataclass(frozen=True, eq=False)
class Slopes:
    """Cost and limits of a motion with their derivatives by the coefficients.

    A limit is a row ``y`` over all samples that must stay within ``+-bound`` or, if it has one side, below it.

    Attributes
    ----------
    cost : float
    gradient : ndarray, shape (k, n m)
    values : ndarray, shape (R, k M)
        All rows.
    own : tuple of (int, int, float)
        For the first rows, which depend on one joint: derivative (0 position, 1 velocity, ...), joint, scale.
    shared : ndarray, shape (R', k, M, n m)
        Derivative of the rows after them.
    rows : ndarray, shape (4, k, M, m)
        The bases.
    """

    cost: float
    gradient: Array
    values: Array
    own: tuple[tuple[int, int, float], ...]
    shared: Array
    rows: Array

    def pull(self, u: Array) -> Array:
        """Return the transposed derivative of all rows times u (R, k M), shape (k, n m)."""
        k, _, width = self.shared.shape[1:]
        m = self.rows.shape[3]
        u = u.reshape(len(u), k, -1)
        result = (
            np.einsum("rkM,rkMx->kx", u[len(self.own) :], self.shared) if len(self.shared) else np.zeros((k, width))
        )
        for row, (kind, joint, scale) in enumerate(self.own):
            result[:, joint * m : (joint + 1) * m] += scale * np.einsum("kM,kMm->km", u[row], self.rows[kind])
        return np.asarray(result)

    def push(self, x: Array) -> Array:
        """Return the derivative of all rows times x (k, n m), shape (R, k M)."""
        m = self.rows.shape[3]
        own = [
            scale * np.einsum("km,kMm->kM", x[:, j * m : (j + 1) * m], self.rows[kind]) for kind, j, scale in self.own
        ]
        shared = np.einsum("rkMx,kx->rkM", self.shared, x)
        return np.concatenate([np.array(own), shared]).reshape(len(self.values), -1)

    def curvature(self, d: Array) -> Array:
        """Return the squares of all derivatives weighted with d (R, k M), summed over samples, shape (k, n m, n m)."""
        k, _, width = self.shared.shape[1:]
        m = self.rows.shape[3]
        d = d.reshape(len(d), k, -1)
        result = np.zeros((k, width, width))
        for part in range(k):
            for row, (kind, joint, scale) in enumerate(self.own):
                place = slice(joint * m, (joint + 1) * m)
                basis = self.rows[kind, part]
                half = basis * (abs(scale) * np.sqrt(d[row, part]))[:, None]
                result[part, place, place] += half.T @ half
            for row, slope in enumerate(self.shared[:, part]):
                half = slope * np.sqrt(d[len(self.own) + row, part])[:, None]
                result[part] += half.T @ half
        return result


@dataclass(frozen=True, eq=False)
class Problem:
    """A task on a grid of times.

    Attributes
    ----------
    task : Task
    rows : ndarray, shape (4, k, M, m)
        Bases and their derivatives at the M times of the limits.
    stride : int
        Every stride-th of them counts in the criterion.
    bounds : ndarray, shape (R,)
        Bound of each row of limits, 1 or a little less to make up for what happens between the times.
    sparse : int
        At every sparse-th of them distances are measured; 1 for all pairs of shapes, else for the likely ones.
    """

    task: Task
    rows: Array
    stride: int
    bounds: Array
    sparse: int = 1

    def sharpened(self, share: float) -> Problem:
        """Return the problem as it is to be solved first (share 0) or last (share 1)."""
        task = self.task
        width = WIDEST * (NARROWEST / WIDEST) ** share
        smooth = replace(task.smooth, width=width * task.limits.velocity)
        return replace(self, task=replace(task, smooth=smooth, criterion=task.criterion.sharpened(share)))

    @property
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

    def values(self, x: Array) -> tuple[float, Array]:
        """Return cost and rows of limits (R, k M) of coefficients; infinite cost, and some rows, where limits are broken."""
        motion = self.motion(x)
        values = self._own(x, motion)
        if not self._kept(values):
            return np.inf, values
        regressor = self.task.smooth.regressor(motion)
        values = self._limited(values, motion, regressor)
        if self._kept(values):
            # Last, as they take longest.
            values = np.concatenate([values, self._distances(motion)[0]])
        return self._cost(regressor)[0] if self._kept(values) else np.inf, values

    def inside(self, x: Array) -> bool:
        """Tell whether all limits are kept, whatever the cost."""
        motion = self.motion(x)
        values = self._own(x, motion)
        if not self._kept(values):
            return False
        values = self._limited(values, motion, self.task.smooth.regressor(motion))
        return self._kept(values) and self._kept(np.concatenate([values, self._distances(motion)[0]]))

    def _kept(self, values: Array) -> bool:
        """Whether the first rows are within their bounds."""
        two, bounds = self.two_sided[: len(values), None], self.bounds[: len(values), None]
        return bool(np.all(np.where(two, np.abs(values), values) < bounds))

    def limited(self, x: Array) -> Array:
        """Return all rows of limits (R, k M), broken or not."""
        motion = self.motion(x)
        values = self._limited(self._own(x, motion), motion, self.task.smooth.regressor(motion))
        return np.concatenate([values, self._distances(motion)[0]])

    def slopes(self, x: Array) -> Slopes:
        """Return cost and limits with their derivatives."""
        task, motion = self.task, self.motion(x)
        k, n = x.shape[:2]
        regressor = task.smooth.regressor(motion)
        torques = self._torques(regressor)
        cost, gradient = self._cost(regressor)
        counted = self._counted(regressor)
        weights = np.zeros_like(regressor)
        scale = 2.0 * self._share[:, None] * task.weights[:, None, None, None] ** 2
        weights.reshape(n, -1, k, motion.samples // k)[..., :: self.stride] = scale * (gradient @ counted).reshape(
            n, -1, k, counted.shape[2] // k
        )
        by_motion, torque = task.smooth.derivatives(motion, weights, task.nominal)
        limited = np.isfinite(task.limits.torque)
        dense = [torque[limited] / task.limits.torque[limited, None, None, None]]
        tool_rows = self._tool_rows(self._tool(motion), True)
        dense += [slope[None] for _, slope in tool_rows]
        near, nearing = self._distances(motion, True)
        dense.append(np.stack([nearing, *2 * [np.zeros_like(nearing)]], axis=1))
        by_kind = by_motion.reshape(3, n, k, -1)
        return Slopes(
            cost=cost,
            gradient=np.einsum("dnkM,dkMm->knm", by_kind, self.rows[:3]).reshape(k, -1),
            values=np.concatenate([self._own(x, motion), torques, *(row[None] for row, _ in tool_rows), near]),
            own=self._own_rows(),
            shared=self._chained(np.concatenate(dense), k),
            rows=self.rows,
        )

    @property
    def _share(self) -> Array:
        """Samples of the criterion that one sample of the grid stands for, shape (k,)."""
        return np.asarray(np.array(self.task.samples) * self.stride / self.rows.shape[2])

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
        return np.array([scale * signals[kind][j] for kind, j, scale in self._own_rows()])

    def _limited(self, own: Array, motion: Motion, regressor: Array) -> Array:
        rows = [row[None] for row, _ in self._tool_rows(self._tool(motion), False)]
        return np.concatenate([own, self._torques(regressor), *rows])

    def _distances(self, motion: Motion, slopes: bool = False) -> tuple[Array, Array]:
        """Return rows of distances, shape (G, k M), with their derivatives by positions (G, n, k M) if asked for."""
        clearance, k = self.task.limits.clearance, self.task.trajectories
        groups = 0 if clearance is None else len(clearance.groups)
        rows = np.zeros((groups, motion.samples))
        slope = np.zeros((groups, *motion.q.shape)) if slopes else np.zeros(0)
        if clearance is not None and groups:
            places = np.arange(motion.samples).reshape(k, -1)[:, :: self.sparse].ravel()
            rows[:, places], nearing = clearance.rows(motion.q[:, places], likely=self.sparse > 1, slopes=slopes)
            if slopes:
                slope[..., places] = nearing
        return rows, slope

    def _torques(self, regressor: Array) -> Array:
        limit = self.task.limits.torque
        torque = np.einsum("jpN,p->jN", regressor, self.task.nominal)
        limited = np.isfinite(limit)
        return np.asarray(torque[limited] / limit[limited, None])

    def _tool(self, motion: Motion) -> ToolMotion | None:
        limits = self.task.limits
        if limits.tool is None or not limits.watches_tool:
            return None
        return tool_motion(limits.tool, motion.q, motion.v, motion.a)

    def _tool_rows(self, tool: ToolMotion | None, slopes: bool) -> list[tuple[Array, Array]]:
        return [] if tool is None else tool_rows(self.task.limits, tool, slopes)

    def _counted(self, regressor: Array) -> Array:
        k = self.task.trajectories
        n, p, samples = regressor.shape
        return regressor.reshape(n, p, k, samples // k)[..., :: self.stride].reshape(n, p, -1)

    def _cost(self, regressor: Array) -> tuple[float, Array]:
        rows = self._counted(regressor) * self.task.weights[:, None, None]
        rows = rows.reshape(*rows.shape[:2], self.task.trajectories, -1) * np.sqrt(self._share)[:, None]
        stacked = rows.transpose(1, 0, 2, 3).reshape(rows.shape[1], -1)
        return self.task.criterion.cost(stacked @ stacked.T + self.task.prior)

    def _chained(self, slopes: Array, k: int) -> Array:
        """Chain derivatives of rows by the motion (R', 3, n, k M) with the basis: (R', k, M, n m)."""
        count, _, n, _ = slopes.shape
        parts = slopes.reshape(count, 3, n, k, -1)
        result = np.einsum("rnkM,kMm->rkMnm", parts[:, 0], self.rows[0])
        for kind in (1, 2):
            result += np.einsum("rnkM,kMm->rkMnm", parts[:, kind], self.rows[kind])
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
        parts = (tool.jacobian_acceleration, 2.0 * tool.jacobian_rate, tool.jacobian)
        slope = 2.0 * np.einsum("dncN,cN->dnN", np.array(parts), unit) if slopes else none
        found.append((np.sum(unit * tool.acceleration, axis=0), slope))
    if np.isfinite(limits.tool_speed):
        unit = tool.velocity / limits.tool_speed**2
        parts = (tool.jacobian_rate, tool.jacobian, np.zeros_like(tool.jacobian))
        slope = 2.0 * np.einsum("dncN,cN->dnN", np.array(parts), unit) if slopes else none
        found.append((np.sum(unit * tool.velocity, axis=0), slope))
    if np.isfinite(limits.floor):
        slope = none
        if slopes:
            slope = np.zeros((3, *tool.jacobian[:, 0].shape))
            slope[0] = -tool.jacobian[:, 2]
        found.append((1.0 + limits.floor - tool.position[2], slope))
    return found
