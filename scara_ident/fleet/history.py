"""An arm over its dates, in units of noise, and how much of the change from date to date is no wear.

Friction, torque scale, offset and delay of a run differ from day to day on any arm. How much, all arms of a fleet say
together: by the differences between neighbouring dates, which hardly hold anything of what changes slowly, without those that
lie far out, as a few arms that do change have them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import NORMAL_MEDIAN, Array, median
from scara_ident.effects import Scene
from scara_ident.estimation.information import UNDETERMINED, orthonormal, triangular
from scara_ident.fleet.causes import RUN_KINDS, Cause, causes_of, run_directions
from scara_ident.fleet.visit import Visit, watched
from scara_ident.model.model import TorqueModel

# Differences beyond so many of their standard deviations, as the median has it, are left out of their rms, and what share
# of a normal variance is left.
TRIM_STDS, TRIMMED_VARIANCE = 3.0, 0.9733
# What differences of neighbouring dates are worth beside independent values: each date is in two of them.
EFFICIENCY = 0.6
# Fewer variances say nothing of each other; degrees of freedom that are as good as infinite; steps to find fewer.
MIN_VARIANCES, LARGE_FREEDOM, NEWTON_STEPS = 5, 1e6, 20


@dataclass(frozen=True, eq=False)
class DateRows:
    """What an arm shows on one date, in units of the noise; R rows of all joints together.

    Attributes
    ----------
    columns : ndarray, shape (R, m)
    torque : ndarray, shape (R,)
    directions : tuple of ndarray, shape (R, s)
        Of each cause.
    runs : ndarray, shape (R, 5 n)
        What one unit of each of `RUN_KINDS` does, joint by joint.
    starts : ndarray of int, shape (n,)
        The first row of each joint.
    """

    columns: Array
    torque: Array
    directions: tuple[Array, ...]
    runs: Array
    starts: NDArray[np.intp]

    def whitened(self, root: Array) -> DateRows:
        """Return the rows with what differs from run to run weighed as the noise it is, of covariance ``root @ root.T``."""
        pull = self.runs @ root
        values, vectors = np.linalg.eigh(pull.T @ pull)
        kept = values > UNDETERMINED * max(float(values[-1]), np.finfo(float).tiny)
        if not np.any(values[kept] > 0.0):
            return self
        along = pull @ (vectors[:, kept] / np.sqrt(values[kept]))
        loss = 1.0 - 1.0 / np.sqrt(1.0 + values[kept])

        def white(signal: Array) -> Array:
            return np.asarray(signal - (along * loss) @ (along.T @ signal))

        each = tuple(white(item) for item in self.directions)
        return DateRows(white(self.columns), white(self.torque), each, white(self.runs), self.starts)


@dataclass(frozen=True, eq=False)
class History:
    """An arm over its dates.

    Attributes
    ----------
    dates : tuple of str
        In order.
    """

    arm: str
    dates: tuple[str, ...]
    visits: tuple[Visit, ...]
    model: TorqueModel

    @cached_property
    def scene(self) -> Scene:
        """What effects ask for."""
        return self.visits[0].reference.scene(self.model)

    @cached_property
    def causes(self) -> tuple[Cause, ...]:
        """What may change."""
        first = self.visits[0]
        return causes_of(self.model, self.scene, watched(self.scene), first.columns, first.std)

    @cached_property
    def _effect_columns(self) -> int:
        """Columns of the watched effects, between the model's and those of the delays."""
        return sum(cause.sizes for cause in self.causes if cause.candidate is not None)

    @cached_property
    def rows(self) -> tuple[DateRows, ...]:
        """What each date says, in units of the noise."""
        return tuple(self._rows(visit) for visit in self.visits)

    @cached_property
    def days(self) -> Array:
        """Days since the first date, shape (dates,)."""
        days = np.array(self.dates, dtype="datetime64[D]")
        return np.asarray((days - days[0]).astype(float))

    @cached_property
    def _left(self) -> list[Array]:
        return common_removed(self.rows)[0]

    def run_sizes(self, kinds: Array) -> tuple[Array, Array]:
        """Return by how much each date differs from all together, and the covariance: shapes (dates, k n) and (dates, k n, k n).

        Parameters
        ----------
        kinds : ndarray, shape (5, k)
            Sums of `RUN_KINDS`, the same on each joint.
        """
        turn = np.kron(np.eye(self.model.robot.n), kinds)
        sizes, covariances = [], []
        for row, rest in zip(self.rows, self._left, strict=True):
            pull = row.runs @ turn
            inverse = _inverse(pull.T @ pull)
            sizes.append(inverse @ (pull.T @ rest))
            unknown = np.diag(inverse) <= 0.0
            covariances.append(np.where(unknown | unknown[:, None], np.nan, inverse))
        return np.array(sizes), np.array(covariances)

    def whitened(self, root: Array) -> tuple[DateRows, ...]:
        """Return the rows with the differences between runs weighed as noise, see `DateRows.whitened`."""
        return tuple(row.whitened(root) for row in self.rows)

    def _rows(self, visit: Visit) -> DateRows:
        count = self._effect_columns
        total = len(self.model.columns) + count + self.model.robot.n
        runs = run_directions(self.model, self.scene.value, visit.columns, count)
        columns, torque, along = [], [], []
        directions: list[list[Array]] = [[] for _ in self.causes]
        for j, (own, factor, rows) in enumerate(zip(visit.columns, visit.factors, visit.rows, strict=True)):
            known = len(own)
            noise = noise_of(factor, rows)
            half = np.zeros((known, known + 1))
            # A joint without noise to go by says nothing.
            if noise > 0.0:
                half[: len(factor[:known])] = factor[:known] / noise
            wide = np.zeros((known, total))
            wide[:, own] = half[:, :-1]
            columns.append(wide)
            torque.append(half[:, -1])
            placed = np.zeros((known, len(RUN_KINDS) * len(visit.columns)))
            placed[:, len(RUN_KINDS) * j : len(RUN_KINDS) * (j + 1)] = half[:, :-1] @ runs[j]
            along.append(placed)
            for found, cause in zip(directions, self.causes, strict=True):
                found.append(half[:, :-1] @ cause.weights[j])
        stacked = tuple(np.concatenate(found) for found in directions)
        starts = np.cumsum([0, *(len(own) for own in torque[:-1])])
        return DateRows(np.concatenate(columns), np.concatenate(torque), stacked, np.concatenate(along), starts)


def common_removed(rows: Sequence[DateRows]) -> tuple[list[Array], list[Array]]:
    """Return what is left of each date's torque with parameters that all dates share, and a basis of what was taken.

    Returns
    -------
    left : list of ndarray, shape (R,)
    basis : list of ndarray, shape (R, r)
        Orthonormal over all dates together.
    """
    stacked = np.concatenate([row.columns for row in rows])
    factor = triangular(stacked)
    basis = stacked @ orthonormal(factor)
    torque = np.concatenate([row.torque for row in rows])
    left = torque - basis @ (basis.T @ torque)
    ends = np.cumsum([len(row.torque) for row in rows])[:-1]
    return np.split(left, ends), np.split(basis, ends)


def freedom_of(steps: int) -> float:
    """Return the degrees of freedom of a scatter of so many differences."""
    return max(1.0, EFFICIENCY * steps)


def scatter(steps: Array, noise: Array) -> Array:
    """Return the variance of one date beyond its noise, from differences between neighbouring dates; 0 where that is none.

    Parameters
    ----------
    steps : ndarray, shape (N, k)
        Differences; NaN where there is none.
    noise : ndarray, shape (N, k)
        Their variance by noise alone.
    """
    return np.maximum(0.0, beyond_noise(steps, noise))


def beyond_noise(steps: Array, noise: Array) -> Array:
    """Return the same as `scatter`, below zero where differences are smaller than their noise."""
    with np.errstate(invalid="ignore"):
        known = np.isfinite(steps) & np.isfinite(noise)
    found = np.zeros(steps.shape[1])
    for k in range(steps.shape[1]):
        own, var = steps[known[:, k], k], noise[known[:, k], k]
        if len(own):
            size = median(np.abs(own)) / NORMAL_MEDIAN
            kept = own[np.abs(own) <= TRIM_STDS * size]
            found[k] = 0.5 * float(np.mean(kept**2) / TRIMMED_VARIANCE - median(var))
    return found


def variance_prior(ratios: Array, freedom: float) -> tuple[float, float]:
    """Return what variances of one kind, as ratios to what they should be, tell of each other.

    They are taken for draws of a scaled inverse chi-squared distribution, whose moments their logarithms tell (Smyth 2004).

    Parameters
    ----------
    ratios : ndarray, shape (N,)
    freedom : float
        Of each.

    Returns
    -------
    freedom : float
        What the others are worth to one: infinity where they differ by no more than chance, 0 where there are too few.
    usual : float
        The ratio to which each is to be drawn.
    """
    from scipy.special import polygamma, psi

    own = ratios[np.isfinite(ratios) & (ratios > 0.0)]
    if len(own) < MIN_VARIANCES:
        return 0.0, 1.0
    logs = np.log(own) - psi(freedom / 2.0) + np.log(freedom / 2.0)
    excess = float(np.var(logs, ddof=1) - polygamma(1, freedom / 2.0))
    if excess <= 1.0 / LARGE_FREEDOM:
        return np.inf, float(np.exp(np.mean(logs)))
    half = 0.5 + 1.0 / excess
    for _ in range(NEWTON_STEPS):
        # Newton's method on the reciprocal, which is convex: it converges from this side.
        value = float(polygamma(1, half))
        half += value * (1.0 - value / excess) / float(polygamma(2, half))
    return 2.0 * half, float(np.exp(np.mean(logs) + psi(half) - np.log(half)))


def noise_of(factor: Array, rows: float) -> float:
    """Return the standard deviation of a row of a joint beside all columns; 0 where nothing tells it."""
    known = factor.shape[1] - 1
    if len(factor) <= known or rows <= known:
        return 0.0
    return float(abs(factor[known, known]) / np.sqrt(rows - known))


def pseudo_inverses(matrices: Array, share: float) -> Array:
    """Return the pseudo-inverses of symmetric matrices, shape (N, k, k), without eigenvalues below a share of the largest.

    As NumPy's of Hermitian matrices, without its sorting, which takes as long as small ones do.
    """
    values, vectors = np.linalg.eigh(matrices)
    determined = np.abs(values) > share * np.max(np.abs(values), axis=1, keepdims=True)
    inverse = np.where(determined, 1.0 / np.where(determined, values, 1.0), 0.0)
    return np.asarray((vectors * inverse[:, None, :]) @ np.swapaxes(vectors, 1, 2))


def _inverse(matrix: Array) -> Array:
    size = np.sqrt(np.diag(matrix))
    entering = size > 0.0
    result = np.zeros_like(matrix)
    if np.any(entering):
        units = np.outer(size[entering], size[entering])
        result[np.ix_(entering, entering)] = (
            pseudo_inverses((matrix[np.ix_(entering, entering)] / units)[None], UNDETERMINED)[0] / units
        )
    return result
