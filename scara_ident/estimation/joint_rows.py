"""Rows of one joint's equation in blocks of time, and their compression without loss of information."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.estimation.information import Information, triangular

# Blocks whose products are made together: more than fit into the cache are no faster.
BLOCKS_AT_ONCE = 64


@dataclass(frozen=True, eq=False)
class JointRows:
    """Rows of one joint within its band, in the order of time, recording after recording.

    Attributes
    ----------
    columns : ndarray of int, shape (k,)
        The model's columns that act on the joint.
    table : ndarray, shape (k + 1, N)
        These columns, then the torque.
    starts : ndarray of int, shape (blocks + 1,)
        Where each block of time begins.
    counts : ndarray, shape (blocks,)
        Samples that the rows of each block stand for.
    sizes : ndarray, shape (blocks,), or None
        Rows of each block before they became a triangular factor; None where they stand as they were.
    """

    columns: NDArray[np.intp]
    table: Array
    starts: NDArray[np.intp]
    counts: Array
    sizes: Array | None = None

    @property
    def independent(self) -> float:
        """Number of rows, before any became a triangular factor."""
        return float(self.table.shape[1] if self.sizes is None else np.sum(self.sizes))

    def information(self, parameters: int, blocks: slice = slice(None)) -> Information:
        """Return the triangular factor of consecutive blocks among all parameters of the model."""
        starts, counts = self.starts[:-1][blocks], self.counts[blocks]
        if not len(starts):
            return Information.empty(parameters)
        stop = self.starts[1:][blocks][-1]
        own = Information.empty(len(self.columns)).absorb_columns(self.table[:, starts[0] : stop])
        return Information(own.factor, float(np.sum(counts))).embed(self.columns, parameters)

    @property
    def samples(self) -> float:
        """Samples that all rows stand for."""
        return float(np.sum(self.counts))

    def left(self, value: Array) -> Array:
        """Return what parameters of the model, shape (p,), leave of the torque of every row, shape (N,)."""
        return np.asarray(self.table[-1] - value[self.columns] @ self.table[:-1])

    def by_block(self, values: Array) -> Array:
        """Return the sums over each block of values of the rows, shape (blocks,)."""
        return np.diff(np.append(0.0, np.cumsum(values))[self.starts])

    def rms(self, value: Array) -> float:
        """Return the rms of what parameters leave of the torque, as the triangular factor has it; 0 without rows."""
        left = self.left(value)
        return float(np.sqrt(left @ left / self.samples)) if self.samples else 0.0

    def part(self, blocks: NDArray[np.intp]) -> JointRows:
        """Return some of the blocks, in their order."""
        if np.array_equal(blocks, np.arange(len(self.counts))):
            return self
        starts = np.concatenate([[0], np.cumsum(np.diff(self.starts)[blocks])])
        sizes = None if self.sizes is None else self.sizes[blocks]
        # Blocks that follow each other are taken together, and a single run of them is not copied.
        runs = np.split(blocks, np.flatnonzero(np.diff(blocks) != 1) + 1)
        parts = [self.table[:, self.starts[run[0]] : self.starts[run[-1] + 1]] for run in runs if len(run)]
        table = parts[0] if len(parts) == 1 else np.concatenate([self.table[:, :0], *parts], axis=1)
        return JointRows(self.columns, table, starts, self.counts[blocks], sizes)

    def faded(self, shares: Array) -> JointRows:
        """Return the rows with each block weighted to count for a share of its samples, shares of shape (blocks,)."""
        size = np.repeat(np.sqrt(shares), np.diff(self.starts))
        return replace(self, table=self.table * size, counts=self.counts * shares)

    def grouped(self, size: int) -> JointRows:
        """Return the rows with so many neighbouring blocks as one, each the triangular factor of its rows where that is less.

        Products of columns, and so every least-squares quantity that looks at blocks as a whole, are those of the rows.
        """
        edges = np.append(np.arange(0, len(self.counts), size), len(self.counts))
        held = np.diff(self.starts).astype(float) if self.sizes is None else self.sizes
        parts = [self.table[:, a:b] for a, b in pairwise(self.starts[edges])]
        most = len(self.table)
        tables = [part if part.shape[1] <= most else triangular(part.T).T for part in parts]
        starts = np.cumsum([0, *(table.shape[1] for table in tables)])
        table = np.concatenate([np.zeros((most, 0)), *tables], axis=1)
        counts, sizes = (np.add.reduceat(each, edges[:-1]) if len(each) else each for each in (self.counts, held))
        return JointRows(self.columns, table, starts, counts, sizes)


def block_products(signals: Array, bounds: NDArray[np.intp]) -> Array:
    """Return the products of signals with each other, block by block, shape (blocks, k, k).

    Parameters
    ----------
    signals : ndarray, shape (k, N)
    bounds : ndarray of int, shape (blocks + 1,)
        Where each block begins.
    """
    lengths, size = np.diff(bounds), len(signals)
    result = np.empty((len(lengths), size, size))
    # Many blocks in one product, filled up with zeros: of one small product each, two threads take longer than one.
    for first in range(0, len(lengths), BLOCKS_AT_ONCE):
        some = lengths[first : first + BLOCKS_AT_ONCE]
        filled = np.zeros((len(some), int(np.max(some)), size))
        inside = np.arange(filled.shape[1]) < some[:, None]
        filled[inside] = signals[:, bounds[first] : bounds[first + len(some)]].T
        np.matmul(filled.swapaxes(1, 2), filled, out=result[first : first + len(some)])
    return result


def joined(
    parts: Sequence[Sequence[JointRows]], columns: Sequence[NDArray[np.intp]]
) -> tuple[tuple[JointRows, ...], NDArray[np.intp]]:
    """Return the rows of several recordings one after the other, joint by joint, and which recording each block is of.

    Parameters
    ----------
    parts : sequence of sequence of JointRows
        Of each recording, of each joint.
    columns : sequence of ndarray of int, shape (k,)
        The model's columns that act on each joint.
    """
    joints = []
    for j, own in enumerate(columns):
        each = [part[j] for part in parts]
        ends = np.cumsum([0, *(rows.table.shape[1] for rows in each)])
        starts = [rows.starts[:-1] + end for rows, end in zip(each, ends[:-1], strict=True)]
        sizes = [np.diff(rows.starts).astype(float) if rows.sizes is None else rows.sizes for rows in each]
        joints.append(
            JointRows(
                own,
                np.concatenate([np.zeros((len(own) + 1, 0)), *(rows.table for rows in each)], axis=1),
                np.concatenate([*starts, ends[-1:]]).astype(np.intp),
                np.concatenate([np.zeros(0), *(rows.counts for rows in each)]),
                np.concatenate(sizes) if any(rows.sizes is not None for rows in each) else None,
            )
        )
    owner = [np.full(len(part[0].counts), k) for k, part in enumerate(parts)]
    return tuple(joints), np.concatenate([np.zeros(0), *owner]).astype(np.intp)
