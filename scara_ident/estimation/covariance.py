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

from scara_ident.estimation.information import Information, merge

Array = NDArray[np.float64]
Block = Sequence[Information]

# With fewer blocks than this many per parameter the matrix of scores is too noisy to stand for itself.
BLOCKS_PER_PARAMETER = 2.5
# Leverage above which a block fixes a direction all but alone, so that its residual says nothing about it.
FULL_LEVERAGE = 0.99
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


def block_covariance(inverse: Array, value: Array, sequences: Sequence[Sequence[Block]]) -> Covariance:
    """Covariance of a least-squares estimate from blocks of rows.

    Parameters
    ----------
    inverse : ndarray, shape (p, p)
        Inverse of ``W.T @ W`` of all rows (and of a prior, if there is one).
    value : ndarray, shape (p,)
        The estimate.
    sequences : sequence of sequence of tuple of Information
        For every recording its blocks in order of time, each with the rows of every joint, weighted as in the
        estimate.

    Returns
    -------
    Covariance
    """
    root = _square_root(inverse)
    count = sum(len(blocks) for blocks in sequences)
    meat = _scattered(root, value, sequences) if count >= BLOCKS_PER_PARAMETER * root.shape[1] else None
    if meat is None:
        return Covariance(_pooled(root, value, sequences), "pooled block", count)
    return Covariance(root @ meat @ root.T, "block", count)


def _scattered(root: Array, value: Array, sequences: Sequence[Sequence[Block]]) -> Array | None:
    """Scatter of the scores block by block; None where a block leaves no residual to judge a direction by."""
    meat = np.zeros((root.shape[1], root.shape[1]))
    for blocks in sequences:
        before = None
        for block in blocks:
            score = _reduced_score(merge(block), root, value)
            if score is None:
                return None
            meat += np.outer(score, score)
            if before is not None:
                meat += 0.5 * (np.outer(score, before) + np.outer(before, score))
            before = score
    return meat


def _pooled(root: Array, value: Array, sequences: Sequence[Sequence[Block]]) -> Array:
    """Covariance as if residuals were white and of one size per joint, the size from all scores together.

    White residuals of variance s^2 leave scores of total power s^2 sum tr(H (1 - H)) with the leverages H.
    """
    joints = len(sequences[0][0])
    matrix = np.zeros((root.shape[0], root.shape[0]))
    total = np.sum(root**2, axis=1)
    unknown = np.zeros(root.shape[0], dtype=bool)
    for j in range(joints):
        power, expected = 0.0, 0.0
        product = np.zeros((root.shape[1], root.shape[1]))
        for blocks in sequences:
            for block in blocks:
                half = block[j].regressor_factor @ root
                score = half.T @ (block[j].projected_torque - block[j].regressor_factor @ value)
                leverage = np.linalg.eigvalsh(half.T @ half)
                power += float(score @ score)
                expected += float(np.sum(leverage * np.clip(1.0 - leverage, 0.0, None)))
                product += half.T @ half
        share = root @ product @ root.T
        if expected > NO_REDUNDANCY:
            matrix += power / expected * share
        else:
            # Rows that fix the parameters without any redundancy say nothing of the noise.
            unknown |= np.diag(share) > NO_REDUNDANCY * total
    matrix[np.diag_indices_from(matrix)] = np.where(unknown, np.inf, np.diag(matrix))
    return matrix


def _reduced_score(block: Information, root: Array, value: Array) -> Array | None:
    """Score of a block in the directions of ``root``, with residuals freed of the bias of fitting."""
    residual = block.projected_torque - block.regressor_factor @ value
    half = block.regressor_factor @ root
    # With H = half half', half' (1 - H)^-1/2 = (1 - half' half)^-1/2 half': the smaller of two symmetric problems.
    leverage, directions = np.linalg.eigh(half.T @ half)
    if leverage[-1] > FULL_LEVERAGE:
        return None
    score = directions.T @ (half.T @ residual)
    return np.asarray(directions @ (score / np.sqrt(1.0 - leverage)))


def _square_root(matrix: Array) -> Array:
    """Return L with ``L @ L.T`` equal to a positive semidefinite matrix, without its null directions."""
    size = np.sqrt(np.clip(np.diag(matrix), 0.0, None))
    size[size == 0.0] = 1.0
    values, vectors = np.linalg.eigh(matrix / np.outer(size, size))
    kept = values > values[-1] * len(values) * np.finfo(float).eps
    return np.asarray(size[:, None] * vectors[:, kept] * np.sqrt(values[kept]))
