"""Standard deviations that stay honest when residuals are correlated in time.

Residuals of a low-passed 1 kHz recording are not independent, so the textbook covariance promises too much. Here
rows are taken in blocks of time, long against the memory of the filter; blocks are nearly independent whatever
happens inside them. Their scores give the cluster-robust covariance with the bias-reduced residuals of Bell and
McCaffrey (2002), unbiased for white residuals, and neighbouring blocks are weighted in by Bartlett's kernel (Newey
and West 1987). All of it follows from the triangular factors of the blocks.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.estimation.joint_rows import JointRows, block_products
from scara_ident.threads import side_by_side

# With fewer blocks than this many per parameter the matrix of scores is too noisy to stand for itself.
BLOCKS_PER_PARAMETER = 2.5
# Leverage above which a block fixes a direction all but alone, so that its residual says nothing about it.
FULL_LEVERAGE = 0.99
# Norm of a block's leverages up to which a series takes a tenth of the time of an eigenvalue problem; at most 53 terms.
SERIES = 0.5
# Redundancy below which nothing is known of a joint's noise.
NO_REDUNDANCY = 1e-9


@dataclass(frozen=True, eq=False)
class Covariance:
    """Covariance of an estimate and how it was found.

    Attributes
    ----------
    matrix : ndarray, shape (p, p)
    kind : {"block", "pooled block"}
        ``block``: every direction from the scatter of its own scores. ``pooled block``: few blocks, or one that
        fixes a direction alone, so the shape of white residuals with a size from the scatter of all scores
        together.
    blocks : int
        Number of blocks.
    """

    matrix: Array
    kind: str
    blocks: int


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
    meat = _scattered(scores, owner) if len(owner) >= BLOCKS_PER_PARAMETER * root.shape[1] else None
    if meat is None:
        return Covariance(_pooled(scores, root), "pooled block", len(owner))
    return Covariance(root @ meat @ root.T, "block", len(owner))


@dataclass(frozen=True, eq=False)
class _Scores:
    """Of one joint, block by block: scores and their products in the directions that its columns tell apart.

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


def _scattered(joints: Sequence[_Scores], owner: NDArray[np.intp]) -> Array | None:
    """Scatter of the scores block by block; None where a block leaves no residual to judge a direction by."""
    products = np.asarray(sum(joint.turn @ joint.products @ joint.turn.T for joint in joints))
    scores = np.asarray(sum(joint.scores @ joint.turn.T for joint in joints))
    # With H = half half', half' (1 - H)^-1/2 = (1 - half' half)^-1/2 half': the smaller of two symmetric problems.
    reduced = inverse_root_times(products, scores)
    if reduced is None:
        return None
    follows = owner[1:] == owner[:-1]
    cross = reduced[1:][follows].T @ reduced[:-1][follows]
    return np.asarray(reduced.T @ reduced + 0.5 * (cross + cross.T))


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


def _pooled(joints: Sequence[_Scores], root: Array) -> Array:
    """Covariance as if residuals were white and of one size per joint, the size from all scores together.

    White residuals of variance s^2 leave scores of total power s^2 sum tr(H (1 - H)) with the leverages H.
    """
    matrix = np.zeros((root.shape[0], root.shape[0]))
    total = np.sum(root**2, axis=1)
    unknown = np.zeros(root.shape[0], dtype=bool)
    for joint in joints:
        # tr(H (1 - H)): leverages of a part of the rows are at most 1.
        expected = float(np.sum(np.trace(joint.products, axis1=1, axis2=2)) - np.sum(joint.products**2))
        turned = root @ joint.turn
        share = turned @ np.sum(joint.products, axis=0) @ turned.T
        if expected > NO_REDUNDANCY:
            matrix += float(np.sum(joint.scores**2)) / expected * share
        else:
            # Rows that fix the parameters without any redundancy say nothing of the noise.
            unknown |= np.diag(share) > NO_REDUNDANCY * total
    matrix[np.diag_indices_from(matrix)] = np.where(unknown, np.inf, np.diag(matrix))
    return matrix


def _square_root(matrix: Array) -> Array:
    """Return L with ``L @ L.T`` equal to a positive semidefinite matrix, without its null directions."""
    size = np.sqrt(np.clip(np.diag(matrix), 0.0, None))
    size[size == 0.0] = 1.0
    values, vectors = np.linalg.eigh(matrix / np.outer(size, size))
    kept = values > values[-1] * len(values) * np.finfo(float).eps
    return np.asarray(size[:, None] * vectors[:, kept] * np.sqrt(values[kept]))
