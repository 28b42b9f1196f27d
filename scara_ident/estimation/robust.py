"""A robust fit, in which the influence of each stretch of time is bounded.

Each joint's rows in each block of time have a weight by their rms residual d, in units of the joint's noise floor (the
median over blocks): Huber's first, min(1, c / d), then Tukey's bisquare, (1 - (d / k)^2)^2, which gives up what is far off
(Huber, *Robust Statistics*, 1981; Beaton and Tukey 1974). The rows are taken in the columns that the triangular factor of
all of them makes orthonormal, in which normal equations lose no digit; those of a joint in as many of its own as act on it,
of which there are half as many.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array, median
from scara_ident.estimation.estimate import Estimate
from scara_ident.estimation.information import Information, joint_noise, orthonormal, weighted
from scara_ident.estimation.joint_rows import JointRows, block_products
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.working_range import determined_directions
from scara_ident.manners import listed
from scara_ident.threads import one_blas_thread, side_by_side

# Blocks whose rms is that many times the noise floor begin to be bounded, and are given up. White noise of ten rows in a block
# varies by 22 %, so that neither touches it.
HUBER = 1.5
TUKEY = 5.0
# Rounds of reweighting with each; later changes are below a hundredth of a standard deviation.
HUBER_ROUNDS, TUKEY_ROUNDS = 4, 3
# Rows for each direction that acts on a joint, beyond which its residual is its noise.
ROWS = 2
# Blocks of a joint: of long recordings, neighbours are one.
MAX_BLOCKS = 400
# Names that a note lists.
LISTED = 4


@dataclass(frozen=True, eq=False)
class RobustFit:
    """Parameters of a bounded-influence fit.

    Attributes
    ----------
    value : ndarray, shape (p,)
        Directions that the rows do not determine are zero.
    noise : ndarray, shape (n,)
        Noise floor of each joint: the median rms residual of its blocks, N m or N.
    weights : tuple of ndarray, shape (blocks,)
        Of each joint's blocks, between 0 and 1; of long recordings neighbours count as one.
    """

    value: Array
    noise: Array
    weights: tuple[Array, ...]


@one_blas_thread()
def robust_fit(observations: Observations) -> RobustFit:
    """Fit a model by Huber's and then Tukey's weights of blocks of time.

    Parameters
    ----------
    observations : Observations
        With at least one row.
    """
    noise = joint_noise(observations.by_joint)
    whole = weighted(observations.by_joint, 1.0 / noise).regressor_factor
    root = orthonormal(whole)

    def of_joint(rows: JointRows, part: Information) -> _Sums:
        return _sums(rows, part.regressor_factor[:, rows.columns], root[rows.columns])

    joints = side_by_side(of_joint, observations.joints, observations.by_joint)
    weights = [np.ones(len(joint.rows)) for joint in joints]
    point = _reweighted(joints, weights, noise, np.zeros(root.shape[1]), _huber, HUBER_ROUNDS)
    # Once events no longer influence the noise, directions that the data do not determine stay at zero, as in `wls`.
    directions = determined_directions(observations, noise)
    if directions is not None:
        kept, sizes = np.linalg.qr((whole @ root).T @ (whole @ directions.kept))
        root, point = np.linalg.solve(sizes.T, directions.kept.T).T, kept.T @ point
        joints = [replace(joint, own=joint.own @ kept) for joint in joints]
    point = _reweighted(joints, weights, noise, point, _tukey, TUKEY_ROUNDS)
    return RobustFit(root @ _solved(joints, weights, noise, point), noise, tuple(weights))


def _reweighted(
    joints: Sequence[_Sums],
    weights: list[Array],
    noise: Array,
    point: Array,
    weigh: Callable[[Array], Array],
    rounds: int,
) -> Array:
    """Continue with weights and noise, which are changed in place, and return the resulting estimate."""
    for _ in range(rounds):
        point = _solved(joints, weights, noise, point)
        for j, joint in enumerate(joints):
            rms = joint.rms(point)
            # A joint with few rows may be fitted exactly; this contains no information about its noise and would give
            # it all the weight.
            floor = median(rms[joint.rows > 0]) if joint.rows.sum() > ROWS * len(joint.own) else 0.0
            # Weights as with one joint's own noise, so that none is fitted at another's cost.
            noise[j] = floor or noise[j]
            weights[j] = weigh(rms / noise[j])
    return point


def _solved(joints: Sequence[_Sums], weights: Sequence[Array], noise: Array, point: Array) -> Array:
    """Return the weighted fit; a direction that only blocks without weight know stays at the point."""
    normal, right = np.zeros((len(point),) * 2), np.zeros(len(point))
    for joint, weight, sigma in zip(joints, weights, noise, strict=True):
        share = weight / sigma**2
        normal += joint.own.T @ np.tensordot(share, joint.products, 1) @ joint.own
        right += (share @ joint.scores) @ joint.own
    least = 1e-9 * np.trace(normal) / max(1, len(point))
    return np.linalg.solve(normal + least * np.eye(len(point)), right + least * point)


@dataclass(frozen=True, eq=False)
class _Sums:
    """Of one joint, block by block: rows (blocks,), squared torque (blocks,), scores (blocks, k), products (blocks, k, k).

    They are of the joint's own k orthonormal columns; of those of all joints these are ``own``, (k, r).
    """

    rows: NDArray[np.intp]
    squares: Array
    scores: Array
    products: Array
    own: Array

    def rms(self, point: Array) -> Array:
        """Return the rms residual of each block."""
        own = self.own @ point
        left = self.squares - 2.0 * self.scores @ own + (self.products @ own) @ own
        return np.sqrt(np.maximum(left, 0.0) / np.maximum(self.rows, 1))


def _sums(rows: JointRows, factor: Array, root: Array) -> _Sums:
    own_root = orthonormal(factor)
    together = np.empty((own_root.shape[1] + 1, rows.table.shape[1]))
    np.matmul(own_root.T, rows.table[:-1], out=together[:-1])
    together[-1] = rows.table[-1]
    bounds = rows.starts[:: max(1, -(-len(rows.counts) // MAX_BLOCKS))]
    bounds = bounds if bounds[-1] == rows.starts[-1] else np.append(bounds, rows.starts[-1])
    products = block_products(together, bounds)
    return _Sums(
        np.diff(bounds),
        products[:, -1, -1],
        products[:, :-1, -1],
        products[:, :-1, :-1].copy(),
        (factor @ own_root).T @ (factor @ root),
    )


def disagreement(estimate: Estimate, robust: RobustFit) -> str | None:
    """Say by how much least squares and the robust fit differ where that is more than the standard deviation.

    Parameters
    ----------
    robust : RobustFit
        Of the same model on the same rows.
    """
    known = ~estimate.undetermined & (estimate.std > 0.0) & np.isfinite(estimate.std)
    shift = np.where(known, (robust.value - estimate.value) / np.where(known, estimate.std, 1.0), 0.0)
    worst = [int(k) for k in np.argsort(-np.abs(shift)) if abs(shift[k]) > 1.0]
    if not worst:
        return None
    said = listed([f"{estimate.model.names[k]} by {shift[k]:+.1f} std" for k in worst], LISTED)
    return f"a robust fit, which limits the influence of each half second, differs from least squares in {said}"


def _huber(size: Array) -> Array:
    return np.asarray(HUBER / np.maximum(size, HUBER))


def _tukey(size: Array) -> Array:
    return np.asarray(np.maximum(0.0, 1.0 - (size / TUKEY) ** 2) ** 2)
