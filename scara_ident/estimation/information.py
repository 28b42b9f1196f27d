"""Information of rows of a linear model: the triangular factor of [regressor | torque].

For rows ``W`` and right-hand side ``u``, the factor R of the QR decomposition of ``[W | u]`` is a sufficient
statistic: every least-squares quantity of any sub-model follows from R and the number of rows. Factors of
different rows merge by one more QR of the factors put on top of each other, exactly and in any order. An empty
factor is the recursion's infinite initial covariance.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.errors import UsageError
from scara_ident.estimation.blas import add_products, solve_rows
from scara_ident.manners import Frozen

# Rounds in which joints are weighted by what they leave, and the least that one may leave, as a share of its torque.
WEIGHTING_ROUNDS = 3
MIN_NOISE_SHARE = 1e-6

# Rows a QR takes at a time: small panels stay in cache, and LAPACK does not thread them.
PANEL_ROWS = 512
# Numbers that stay in cache as a whole, so that they are factored at once.
AT_ONCE = 2**16
# From so many rows on a preconditioned Gram matrix is made, of so many rows at a time; and how near to singular it may
# be (reciprocal condition): of sixteen digits three are then lost of a matrix that is otherwise close to the identity.
GRAM_ROWS = 2048
NEAR_SINGULAR = 1e-3
# Directions whose singular value, with columns scaled to unit length, is below this share of the largest are
# not determined: half the digits of a double.
UNDETERMINED = 1e-10
# Reciprocal condition, as LAPACK estimates it in the norm of sums, above which no direction is near that share: the singular
# values, which take ten times as long as the solution, need not be asked.
SURELY = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class Information(Frozen):
    """Triangular factor of ``[W | u]`` with its number of rows.

    Attributes
    ----------
    factor : ndarray, shape (k, p + 1)
        Upper triangular with at most p + 1 rows; ``factor.T @ factor`` equals ``[W | u].T @ [W | u]``.
    rows : float
        Number of rows (of equal weight 1) that it contains.
    """

    factor: Array
    rows: float

    @staticmethod
    def empty(parameters: int) -> Information:
        """Return the information of no rows: no parameter is determined."""
        return Information(np.zeros((0, parameters + 1)), 0.0)

    @staticmethod
    def prior(mean: Array, std: Array) -> Information:
        """Return the rows of a prior: each parameter is ``mean`` with standard deviation ``std``.

        Parameters
        ----------
        mean, std : ndarray, shape (p,)
            Infinite std: no prior for that parameter.

        Raises
        ------
        ValueError
            If a std is not positive.
        """
        if np.any(~(std > 0.0)):
            raise ValueError(f"std of a prior must be positive, found {std[~(std > 0.0)][0]:g}")
        weight = np.where(np.isinf(std), 0.0, 1.0 / std)
        return Information(triangular(np.column_stack([np.diag(weight), weight * mean])), 0.0)

    @property
    def parameters(self) -> int:
        """Number of parameters p."""
        return int(self.factor.shape[1]) - 1

    @property
    def regressor_factor(self) -> Array:
        """R of the regressor alone, shape (p, p), with fewer rows if there were fewer."""
        return self.factor[: self.parameters, :-1]

    @property
    def projected_torque(self) -> Array:
        """Torque projected on the regressor's range: the right-hand side of `regressor_factor`."""
        return self.factor[: self.parameters, -1]

    def absorb(self, regressor: Array, torque: Array, *, decay: float = 1.0) -> Information:
        """Return this information with more rows.

        Parameters
        ----------
        regressor : ndarray, shape (N, p)
        torque : ndarray, shape (N,)
        decay : float, optional
            Factor on the earlier information, as in forgetting; 1 keeps it.

        Raises
        ------
        ValueError
            If the shapes do not fit.
        """
        if regressor.ndim != 2 or regressor.shape[1] != self.parameters or torque.shape != regressor.shape[:1]:
            raise ValueError(
                f"expected a regressor (N, {self.parameters}) and a torque (N,), "
                f"found {regressor.shape} and {torque.shape}"
            )
        return self.absorb_columns(np.vstack([regressor.T, torque]), decay=decay)

    def absorb_columns(self, columns: Array, *, decay: float = 1.0) -> Information:
        """Return this information with more rows given as columns ``[W | u].T``, shape (p + 1, N)."""
        factor = np.sqrt(decay) * self.factor
        count = columns.shape[1]
        whole = None
        if columns.size <= AT_ONCE:
            whole = triangular(np.vstack([factor, columns.T]) if len(factor) else columns.T)
        elif count >= GRAM_ROWS:
            whole = _updated(factor, columns, np.eye(len(columns)))
            if whole is None:
                some = triangular(columns[:, :: count // PANEL_ROWS].T)
                alone = _updated(some, columns, np.zeros((len(columns), len(columns))))
                whole = alone if alone is None or not len(factor) else triangular(np.vstack([factor, alone]))
        if whole is None:
            # Equal panels, so that the last is not a sliver.
            bounds = np.linspace(0, count, max(1, -(-count // PANEL_ROWS)) + 1).astype(int)
            factors = [triangular(columns[:, a:b].T) for a, b in pairwise(bounds) if b > a]
            whole = triangular(np.vstack([factor, *factors]))
        return Information(whole, decay * self.rows + count)

    def moved(self, change: Array) -> Information:
        """Return the information of the same rows with a torque changed by that of parameters (p,)."""
        factor = self.factor.copy()
        factor[:, -1] += factor[:, :-1] @ change
        return Information(factor, self.rows)

    def scaled(self, weight: float) -> Information:
        """Return this information with every row multiplied by ``weight``."""
        return Information(weight * self.factor, self.rows)

    def select(self, columns: Sequence[int] | NDArray[np.intp]) -> Information:
        """Return the information of the sub-model that has these columns only."""
        kept = [*columns, self.parameters]
        return Information(triangular(self.factor[:, kept]), self.rows)

    def embed(self, columns: Sequence[int] | NDArray[np.intp], parameters: int) -> Information:
        """Return the information in a larger model whose other columns are zero on these rows."""
        wide = np.zeros((len(self.factor), parameters + 1))
        wide[:, [*columns, parameters]] = self.factor
        # Columns in their order leave it triangular.
        return Information(wide if np.all(np.diff(columns) > 0) else triangular(wide), self.rows)

    def solve(self) -> Solution:
        """Return the least-squares estimate and the undetermined parameters."""
        r = self.regressor_factor
        size = np.linalg.norm(r, axis=0)
        entering = size > 0.0
        value = np.zeros(self.parameters)
        undetermined = ~entering
        null = np.eye(self.parameters)[:, ~entering]
        # Without columns that are zero it is triangular no more.
        rows = self.factor if np.all(entering) else triangular(self.factor[:, np.append(entering, True)])
        count = np.count_nonzero(entering)
        known = _surely_determined(rows[:count, :-1] / size[entering], rows[:count, -1])
        if known is not None:
            value[entering] = known / size[entering]
        elif np.any(entering):
            scaled = r[:, entering] / size[entering]
            left, singular, right = np.linalg.svd(scaled)
            rank = int(np.count_nonzero(singular > UNDETERMINED * singular[0]))
            seen = right[:rank].T / singular[:rank] @ (left[:, :rank].T @ self.projected_torque)
            value[entering] = seen / size[entering]
            blind = right[rank:].T
            undetermined[entering] = np.linalg.norm(blind, axis=1) > np.sqrt(UNDETERMINED)
            spread = np.zeros((self.parameters, blind.shape[1]))
            spread[entering] = blind / size[entering][:, None]
            null = np.column_stack([null, spread])
        return Solution(value, undetermined, null)

    def inverse(self) -> Array:
        """Return the inverse of ``W.T @ W`` on the determined subspace, shape (p, p)."""
        half = orthonormal(self.regressor_factor)
        return half @ half.T

    def std(self) -> Array:
        """Return the std of every parameter for rows of unit noise, shape (p,); infinite if undetermined."""
        variance = np.diag(self.inverse()).copy()
        variance[self.solve().undetermined] = np.inf
        return np.sqrt(variance)

    def residual_sum(self, value: Array | None = None) -> float:
        """Return the sum of squared residuals of parameters, by default of the least-squares estimate."""
        if value is None:
            value = self.solve().value
        return float(np.sum((self.factor[:, :-1] @ value - self.factor[:, -1]) ** 2))

    def rms(self, value: Array | None = None) -> float:
        """Return the rms residual of parameters over the rows, by default of the least-squares estimate."""
        return float(np.sqrt(self.residual_sum(value) / self.rows)) if self.rows else 0.0

    @property
    def torque_rms(self) -> float:
        """Rms of the torque over the rows."""
        return float(np.linalg.norm(self.factor[:, -1]) / np.sqrt(self.rows)) if self.rows else 0.0

    def noise(self, value: Array) -> float:
        """Return the rms residual of parameters as an estimate of the noise; 1 without rows or torque.

        Rows that are `saturated` are fitted exactly, so their noise may be as large as the torque. An exact fit of more
        rows would give an infinite weight, so rounding is the smallest value.
        """
        least = 1.0 if self.saturated else MIN_NOISE_SHARE
        return max(self.rms(value), least * self.torque_rms) or 1.0

    @property
    def saturated(self) -> bool:
        """Whether there are no more rows than directions that they determine, so that they are fitted exactly."""
        rows = self.factor[:, :-1]
        size = np.linalg.norm(rows, axis=0)
        if not 0 < len(rows) <= np.count_nonzero(size):
            return False
        singular = np.linalg.svd(rows / np.where(size > 0.0, size, 1.0), compute_uv=False)
        return bool(singular[len(rows) - 1] > UNDETERMINED * singular[0])

    def log_det(self) -> float:
        """Return ln det(W.T W), -inf if W does not have full rank (J_d of Indri et al. 2002)."""
        size = np.linalg.norm(self.regressor_factor, axis=0)
        if not self._full_rank(size):
            return -np.inf
        singular = np.linalg.svd(self.regressor_factor / size, compute_uv=False)
        return float(2.0 * (np.sum(np.log(singular)) + np.sum(np.log(size))))

    def condition(self) -> float:
        """Return cond(W.T W), inf if W does not have full rank (J_k of Indri et al. 2002)."""
        if not self._full_rank(np.linalg.norm(self.regressor_factor, axis=0)):
            return np.inf
        singular = np.linalg.svd(self.regressor_factor, compute_uv=False)
        return float((singular[0] / singular[-1]) ** 2)

    def _full_rank(self, size: Array) -> bool:
        # As in `solve`: rounding leaves a zero singular value at 1e-16 of the largest, not at 0.
        if size.size == 0 or np.any(size == 0.0) or len(self.regressor_factor) < len(size):
            return False
        singular = np.linalg.svd(self.regressor_factor / size, compute_uv=False)
        return bool(singular[-1] > UNDETERMINED * singular[0])


@dataclass(frozen=True, eq=False)
class Solution:
    """A least-squares estimate.

    Attributes
    ----------
    value : ndarray, shape (p,)
        Estimate; along undetermined directions the shortest one in scaled columns.
    undetermined : ndarray of bool, shape (p,)
        Parameters that the rows do not determine, alone or in a combination.
    null : ndarray, shape (p, k)
        A basis of the directions that change no predicted torque on these rows.
    """

    value: Array
    undetermined: NDArray[np.bool_]
    null: Array


def merge(parts: Iterable[Information]) -> Information:
    """Merge the information of different sets of rows; the order does not matter.

    Parameters
    ----------
    parts : iterable of Information
        At least one, all with the same parameters.

    Raises
    ------
    UsageError
        If there is none, or they have different numbers of parameters.
    """
    items = list(parts)
    if not items:
        raise UsageError("nothing to merge: give the information of at least one set of rows")
    counts = {item.parameters for item in items}
    if len(counts) > 1:
        raise UsageError(f"information about {' and '.join(map(str, sorted(counts)))} parameters cannot be merged")
    stacked = np.vstack([item.factor for item in items])
    return Information(triangular(stacked), sum(item.rows for item in items))


def weighted(joints: Sequence[Information], weights: Array) -> Information:
    """Merge the rows of several joints, each joint's with its weight."""
    return merge(part.scaled(float(weight)) for part, weight in zip(joints, weights, strict=True))


def joint_noise(joints: Sequence[Information]) -> Array:
    """Return the rms residual of each joint when each is weighted by its own, shape (n,); 1 for a joint without rows.

    In rounds: fitted with equal weights, a bad joint spoils the residual of a good one.

    Parameters
    ----------
    joints : sequence of Information
        All rows of each joint.
    """
    noise = np.ones(len(joints))
    for _ in range(WEIGHTING_ROUNDS):
        noise = residual_noise(joints, weighted(joints, 1.0 / noise).solve().value)
    return noise


def residual_noise(joints: Sequence[Information], value: Array) -> Array:
    """Return the std of each joint's rows from the residuals of parameters, shape (n,), see `Information.noise`."""
    return np.array([part.noise(value) for part in joints])


def _surely_determined(factor: Array, right: Array) -> Array | None:
    """Solve a system whose columns have unit length; None if it is not triangular or a direction may be undetermined."""
    from scipy.linalg.lapack import dtrcon, dtrtrs

    size = factor.shape[1]
    if not 0 < size <= len(factor) or np.any(factor[~_above(*factor.shape)]) or not dtrcon(factor[:size])[0] > SURELY:
        return None
    return np.asarray(dtrtrs(factor[:size], right)[0])


def orthonormal(factor: Array) -> Array:
    """Return the sums of columns, shape (p, r), that are orthonormal on the rows of a triangular factor, shape (k, p).

    Directions that are not determined are left out.
    """
    size = np.linalg.norm(factor, axis=0)
    entering = size > 0.0
    if not np.any(entering):
        return np.zeros((factor.shape[1], 0))
    if np.all(entering):
        inverse = _surely_determined(factor / size, np.eye(len(size)))
        if inverse is not None:
            return np.asarray(inverse / size[:, None])
    _, singular, right = np.linalg.svd(factor[:, entering] / size[entering], full_matrices=False)
    known = singular > UNDETERMINED * singular[0]
    result = np.zeros((factor.shape[1], int(np.count_nonzero(known))))
    result[entering] = right[known].T / singular[known] / size[entering][:, None]
    return result


def triangular(rows: Array) -> Array:
    """Triangular factor of rows; rows that are fewer than the columns are kept as they are."""
    if rows.shape[0] <= 1:
        return rows
    # As mode "r" does, but for the mask of what is above the diagonal, which takes as long as a small factor.
    raw = np.linalg.qr(rows, mode="raw")[0].T
    least = min(rows.shape)
    return np.where(_above(least, rows.shape[1]), raw[:least], 0.0)


@lru_cache(maxsize=256)
def _above(rows: int, columns: int) -> NDArray[np.bool_]:
    return np.asarray(np.tri(rows, columns, -1) == 0.0)


def _updated(factor: Array, columns: Array, gram: Array) -> Array | None:
    """Triangular factor of rows by the Cholesky factor of their Gram matrix; None where that would lose digits.

    Rows are first solved against a triangular factor that is near theirs (Yamazaki, Tomov and Dongarra, SIAM J. Sci.
    Comput. 37, 2015, on what a plain Gram matrix loses): what is left is near to orthonormal, and each row's solution is
    exact for a row that differs by rounding. So this is as accurate as Householder's, in products of matrices.

    Parameters
    ----------
    factor : ndarray, shape (m, k)
    columns : ndarray, shape (k, N)
    gram : ndarray, shape (k, k)
        What stands for other rows, in units of the factor: the identity for those that it is the factor of.
    """
    from scipy.linalg.lapack import dpocon, dpotrf

    if factor.shape[0] < factor.shape[1] or not np.all(np.diag(factor)):
        return None
    upper, gram = np.asfortranarray(factor), np.array(gram, order="F")
    for start in range(0, columns.shape[1], GRAM_ROWS):
        part = columns[:, start : start + GRAM_ROWS].copy()
        solve_rows(upper, part)
        add_products(part, gram)
    # Only the upper half is filled.
    half = np.abs(gram)
    size = float(np.max(half.sum(axis=0) + np.triu(half, 1).sum(axis=1)))
    root, failed = dpotrf(gram)
    if failed or not np.isfinite(size) or dpocon(root, size)[0] < NEAR_SINGULAR:
        return None
    return np.asarray(root @ factor)
