"""Standard deviations that stay honest when residuals are correlated in time.

Residuals of a low-passed 1 kHz recording are not independent, so the textbook covariance promises too much. Here
rows are taken in blocks of time, long against the memory of the filter; blocks are nearly independent whatever
happens inside them. Their scores give the cluster-robust covariance with the bias-reduced residuals of Bell and
McCaffrey (2002), and neighbouring blocks are weighted in by Bartlett's kernel (Newey and West 1987). With few blocks the
shape is that of white residuals, and the size that of the scores over times as long as the recording (the same kernel with
the bandwidth of Kiefer and Vogelsang 2002): what a model lacks follows the motion, slower than any block. Both are
unbiased for white residuals, and as many degrees of freedom as the scores have widen them (Satterthwaite 1946), so that two
standard deviations cover 95 %. All of it follows from the triangular factors of the blocks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.estimation.joint_rows import JointRows, block_products
from scara_ident.estimation.student_t import widening
from scara_ident.threads import side_by_side

# With fewer blocks per parameter than this the matrix of scores is too noisy to be used directly.
BLOCKS_PER_PARAMETER = 2.5
# Leverage above which a block determines a direction almost alone, so its residual contains no information about it.
FULL_LEVERAGE = 0.99
# Norm of a block's leverages up to which a series takes a tenth of the time of an eigenvalue problem; at most 53 terms.
SERIES = 0.5
# Ratio of the squares of leverages to their sum that is more than rounding.
ROUNDED = 1.0 + 1e-6
# Redundancy below which nothing is known of a joint's noise.
NO_REDUNDANCY = 1e-9
# Largest number of parts of a recording for the correlation over all times up to its length; more blocks are merged
# with their neighbours.
MAX_PARTS = 12
# A variance from fewer degrees of freedom than one is not widened further.
MIN_FREEDOM = 1.0
# Number of blocks whose products with all parameters are computed together, to limit the memory for long recordings.
BLOCKS_AT_ONCE = 64


@dataclass(frozen=True, eq=False)
class Covariance:
    """Covariance of an estimate and how it was found.

    Attributes
    ----------
    matrix : ndarray, shape (p, p)
        Widened by the degrees of freedom.
    kind : {"block", "pooled block"}
        ``block``: every direction from the scatter of its own scores. ``pooled block``: few blocks, or one that
        fixes a direction alone, so the shape of white residuals with a size from the scatter of all scores
        together.
    blocks : int
        Number of blocks.
    freedom : ndarray, shape (p,)
        Degrees of freedom of each parameter's variance.
    """

    matrix: Array
    kind: str
    blocks: int
    freedom: Array


def block_covariance(
    inverse: Array, value: Array, joints: Sequence[JointRows], owner: NDArray[np.intp], weights: Array
) -> Covariance:
    """Covariance of a least-squares estimate from blocks of rows.

    Parameters
    ----------
    inverse : ndarray, shape (p, p)
        Inverse of ``W.T @ W`` of all rows (and of a prior, if there is one).
    value : ndarray, shape (p,)
        The estimate.
    joints : sequence of JointRows
        Rows of every joint.
    owner : ndarray of int, shape (blocks,)
        Recording of each block; blocks of one recording follow each other in time.
    weights : ndarray, shape (n,)
        Weight of each joint's rows in the estimate.
    """
    root = _square_root(inverse)
    scores = side_by_side(lambda rows, weight: _scores(rows, weight, root, value), joints, weights)
    found = _scattered(scores, root, owner) if len(owner) >= BLOCKS_PER_PARAMETER * root.shape[1] else None
    kind = "block" if found else "pooled block"
    matrix, freedom = found or _pooled(scores, root, owner)
    wider = widening(np.maximum(freedom, MIN_FREEDOM))
    return Covariance(matrix * np.outer(wider, wider), kind, len(owner), freedom)


@dataclass(frozen=True, eq=False)
class _Scores:
    """The scores of one joint by block, and their products in the directions that its columns determine.

    Attributes
    ----------
    turn : ndarray, shape (r, k)
        These directions, orthonormal, among those of the root.
    scores : ndarray, shape (blocks, k)
    products : ndarray, shape (blocks, k, k)
    """

    turn: Array
    scores: Array
    products: Array


def _scores(rows: JointRows, weight: float, root: Array, value: Array) -> _Scores:
    # The columns of a joint are fewer than the parameters, so that its products need not be as large.
    turn, factor = np.linalg.qr(root[rows.columns].T)
    together = np.empty((len(factor) + 1, rows.table.shape[1]))
    np.matmul(factor, rows.table[:-1], out=together[:-1])
    together[-1] = rows.left(value)
    products = weight**2 * block_products(together, rows.starts)
    return _Scores(turn, products[:, :-1, -1], products[:, :-1, :-1])


def _scattered(joints: Sequence[_Scores], root: Array, owner: NDArray[np.intp]) -> tuple[Array, Array] | None:
    """Covariance from the scatter of block scores, and its degrees of freedom; None if a block determines a direction alone."""
    products = np.asarray(sum(joint.turn @ joint.products @ joint.turn.T for joint in joints))
    scores = np.asarray(sum(joint.scores @ joint.turn.T for joint in joints))
    # With H = half half', half' (1 - H)^-1/2 = (1 - half' half)^-1/2 half': the smaller of two symmetric problems.
    reduced = inverse_root_times(products, scores)
    if reduced is None:
        return None
    follows = owner[1:] == owner[:-1]
    cross = reduced[1:][follows].T @ reduced[:-1][follows]
    meat = reduced.T @ reduced + 0.5 * (cross + cross.T)
    share, freedom = _of_white(products, root, follows)
    return root @ meat @ root.T / np.sqrt(np.outer(share, share)), freedom


def _of_white(products: Array, root: Array, follows: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return of each parameter, were residuals white, the share of its variance that blocks and their neighbours show, and its freedom.

    The fit makes the scores of neighbouring blocks slightly negatively correlated. The degrees of freedom are those of
    the equivalent number of blocks of equal weight for the parameter.
    """
    variance = np.sum(root**2, axis=1)
    opposed, squares, neighbours = (np.zeros(len(root)) for _ in range(3))
    # Those of the block before; nothing precedes the first.
    before, leverages_before = np.zeros_like(root.T), np.zeros(len(root))
    follows = np.append(False, follows)
    for first in range(0, len(products), BLOCKS_AT_ONCE):
        pulls = products[first : first + BLOCKS_AT_ONCE] @ root.T
        leverages = np.einsum("pr,brp->bp", root, pulls)
        after = follows[first : first + BLOCKS_AT_ONCE].astype(float)
        earlier = np.concatenate([before[None], pulls[:-1]])
        opposed += np.einsum("b,brp,brp->p", after, pulls, earlier)
        squares += np.sum(leverages**2, axis=0)
        neighbours += after @ (leverages * np.concatenate([leverages_before[None], leverages[:-1]]))
        before, leverages_before = pulls[-1], leverages[-1]
    some = variance > 0.0
    share = 1.0 - np.divide(opposed, variance, out=np.zeros(len(root)), where=some)
    together = squares + 0.5 * neighbours
    # What no block shows has no more freedom than one block.
    freedom = np.divide(variance**2, together, out=np.ones(len(root)), where=some & (together > 0.0))
    return share, freedom


def inverse_root_times(products: Array, scores: Array) -> Array | None:
    """Return ``(1 - P)^-1/2 s`` of each block; None where the largest eigenvalue of a P is above `FULL_LEVERAGE`.

    Parameters
    ----------
    products : ndarray, shape (blocks, r, r)
        P, positive semidefinite.
    scores : ndarray, shape (blocks, r)
    """
    # No eigenvalue is larger than this norm.
    norms = np.sqrt(np.einsum("bij,bij->b", products, products))
    weak, result = norms <= SERIES, np.empty_like(scores)
    if not np.all(weak):
        leverage, directions = np.linalg.eigh(products[~weak])
        if np.any(leverage[:, -1] > FULL_LEVERAGE):
            return None
        turned = np.einsum("bji,bj->bi", directions, scores[~weak]) / np.sqrt(1.0 - leverage)
        result[~weak] = np.einsum("bij,bj->bi", directions, turned)
    # The binomial series, to where all that follows is rounding.
    products, term = products[weak], scores[weak]
    total, power, largest = term.copy(), 0, float(np.max(norms[weak], initial=0.0))
    while largest**power > np.finfo(float).eps:
        power += 1
        term = (products @ term[:, :, None])[:, :, 0] * (1.0 - 0.5 / power)
        total += term
    result[weak] = total
    return result


def _pooled(joints: Sequence[_Scores], root: Array, owner: NDArray[np.intp]) -> tuple[Array, Array]:
    """Covariance as if residuals were white and of one size per joint, the size from all scores together, and its freedom."""
    matrix = np.zeros((root.shape[0], root.shape[0]))
    total = np.sum(root**2, axis=1)
    unknown = np.zeros(root.shape[0], dtype=bool)
    unsure = np.zeros(root.shape[0])
    powers = side_by_side(lambda joint: _powers(*_within_rows(joint), owner), joints)
    for joint, (power, expected, spread) in zip(joints, powers, strict=True):
        turned = root @ joint.turn
        share = turned @ np.sum(joint.products, axis=0) @ turned.T
        if expected > NO_REDUNDANCY:
            part = power / expected * share
            matrix += part
            unsure += (np.diag(part) / expected) ** 2 * spread
        else:
            # Rows without redundancy contain no information about the noise.
            unknown |= np.diag(share) > NO_REDUNDANCY * total
    freedom = np.divide(np.diag(matrix) ** 2, unsure, out=np.ones(len(total)), where=unsure > 0.0)
    matrix[np.diag_indices_from(matrix)] = np.where(unknown, np.inf, np.diag(matrix))
    return matrix, freedom


def _within_rows(joint: _Scores) -> tuple[Array, Array]:
    """Return scores and products in directions that rows fix no more than wholly: where some are hardly determined, rounding has leverages above 1."""
    total = np.sum(joint.products, axis=0)
    # Of leverages up to 1 the squares are no more than they are.
    if np.sum(total**2) <= ROUNDED * np.trace(total):
        return joint.scores, joint.products
    size, turn = np.linalg.eigh(total)
    turn = turn / np.sqrt(np.maximum(size, 1.0))
    return joint.scores @ turn, turn.T @ joint.products @ turn


def _powers(scored: Array, leverages: Array, owner: NDArray[np.intp]) -> tuple[float, float, float]:
    """Return the power of a joint's scores over times up to whole recordings, and of white residuals of variance 1 its mean and half its variance.

    With Bartlett's weights K of two parts of a recording, from 1 down to none at its length, the power is ``sum K_ab s_a' s_b``. White residuals
    leave scores with the covariance ``G_ab = [a = b] H_a - H_a H_b`` by the leverages H: its mean is tr(K G), its variance 2 tr(K G K G).
    """
    power = expected = spread = 0.0
    between = np.zeros(leverages.shape[1:])
    for run in np.unique(owner):
        first, stop = np.searchsorted(owner, [run, run + 1])
        bounds = np.linspace(first, stop, min(stop - first, MAX_PARTS) + 1).astype(np.intp)
        scores, products = scored[first:stop], leverages[first:stop]
        if stop - first > MAX_PARTS:
            scores, products = (np.add.reduceat(each, bounds[:-1] - first) for each in (scores, products))
        apart = np.arange(len(scores))
        kernel = 1.0 - np.abs(apart[:, None] - apart) / len(apart)
        flat = products.reshape(len(apart), -1)
        near = (kernel @ flat).reshape(products.shape)
        shared = products @ near
        both = np.sum(shared, axis=0)
        power += float(np.sum(scores * (kernel @ scores)))
        expected += float(np.trace(np.sum(products, axis=0)) - np.trace(both))
        spread += float(np.sum(kernel**2 * (flat @ flat.T)) - 2.0 * np.sum(near * shared))
        between += both
    return power, expected, spread + float(np.sum(between * between.T))


def _square_root(matrix: Array) -> Array:
    """Return L with ``L @ L.T`` equal to a positive semidefinite matrix, without its null directions."""
    size = np.sqrt(np.clip(np.diag(matrix), 0.0, None))
    size[size == 0.0] = 1.0
    values, vectors = np.linalg.eigh(matrix / np.outer(size, size))
    kept = values > values[-1] * len(values) * np.finfo(float).eps
    return np.asarray(size[:, None] * vectors[:, kept] * np.sqrt(values[kept]))
