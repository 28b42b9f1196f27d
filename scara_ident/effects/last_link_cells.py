"""What short cells of time say of a body on the last link, beside the base model and offsets of each recording's own.

Of each cell only products of the body's columns are kept, and of all recordings together those of the base model: nothing
grows with the number of samples, and with the number of cells only what a body's few columns need.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.recording_groups import rows_of_last_link
from scara_ident.effects.signals import Scene

# Cells last this long at the least, s, a sixth of what is carried shortest, and there are so many in all recordings together:
# more would tell instants better, and take more time and memory than they are worth here.
LEAST_CELL, MOST_CELLS = 0.05, 8192
# Directions of columns of unit size below this share are rounding.
_RANK = 1e-9


@dataclass(frozen=True, eq=False)
class RecordingCells:
    """One recording in C cells of time, for n joints, p columns of the base model and k of a body.

    Attributes
    ----------
    bounds : ndarray, shape (C + 1,)
        Seconds since the recording began.
    squares : ndarray, shape (C, k, k)
        Weighted products of the body's columns.
    across : ndarray, shape (C, k, p + 1)
        With the base model's columns, and with the torque.
    sums : ndarray, shape (C, n, k)
        Sums of the body's columns over the rows of each joint.
    whole : ndarray, shape (n, p + 1)
        Sums of the base model's columns and of the torque over all rows of each joint.
    rows : ndarray, shape (n,)
        Number of rows of each joint.
    """

    name: str
    bounds: Array
    squares: Array
    across: Array
    sums: Array
    whole: Array
    rows: Array


@dataclass(frozen=True, eq=False)
class Cells:
    """All recordings, and what the base model says of them beside offsets of each one's own.

    Attributes
    ----------
    weights : ndarray, shape (n,)
        Of the squares of each joint's rows: one over what the base model leaves of one.
    inverse, aim : ndarray, shapes (p, p) and (p,)
        Of the normal equations of the base model.
    """

    each: tuple[RecordingCells, ...]
    weights: Array
    inverse: Array
    aim: Array

    def normal(self, states: Sequence[Array]) -> tuple[Array, Array, Array]:
        """Return the normal equations of a body that acts in some cells, the base model and offsets taken off.

        Parameters
        ----------
        states : sequence of ndarray, each of shape (C,)
            How much of each cell of a recording it acts in.

        Returns
        -------
        tuple of ndarray
            Products (k, k), right sides (k,), and products with the base model (k, p).
        """
        squares, reach, right = self._beside_offsets(states)
        return squares - reach @ self.inverse @ reach.T, right - reach @ (self.inverse @ self.aim), reach

    def _beside_offsets(self, states: Sequence[Array]) -> tuple[Array, Array, Array]:
        size, reach = self.each[0].squares.shape[1], self.each[0].across.shape[2]
        squares, across = np.zeros((size, size)), np.zeros((size, reach))
        for item, state in zip(self.each, states, strict=True):
            inside = np.tensordot(state, item.sums, 1)
            share = (self.weights / np.maximum(item.rows, 1.0))[:, None] * inside
            squares += np.tensordot(state, item.squares, 1) - share.T @ inside
            across += np.tensordot(state, item.across, 1) - share.T @ item.whole
        return squares, across[:, :-1], across[:, -1]

    def scores(self, states: Sequence[Array], body: Array) -> tuple[list[Array], list[Array]]:
        """Return what cells say of a body where it acts as given and all else is fitted beside it.

        Parameters
        ----------
        states : sequence of ndarray, each of shape (C,)
        body : ndarray, shape (k,)

        Returns
        -------
        tuple of list of ndarray
            Of each recording the products of what the body makes in a cell with what is left there without it, and its
            squares, (C,) each.
        """
        _, _, reach = self.normal(states)
        value = self.inverse @ (self.aim - reach.T @ body)
        seen, made = [], []
        for item, state in zip(self.each, states, strict=True):
            rows = np.maximum(item.rows, 1.0)
            offset = (item.whole[:, -1] - item.whole[:, :-1] @ value - np.tensordot(state, item.sums, 1) @ body) / rows
            along = item.across @ np.append(-value, 1.0) - np.einsum("cjk,j->ck", item.sums, self.weights * offset)
            seen.append(along @ body)
            made.append(np.einsum("k,ckl,l->c", body, item.squares, body))
        return seen, made


def cells_of(scene: Scene, shown: Sequence[int], names: Sequence[str], weights: Array) -> Cells:
    """Return what cells of recordings say of a body on the last link.

    Parameters
    ----------
    scene : Scene
        With the base model's columns on motions that carry the recorded torque.
    shown : sequence of int
        Standard parameters of the body.
    names : sequence of str
        Recordings.
    weights : ndarray, shape (n,)
        Of the squares of each joint's rows.
    """
    p = len(scene.value)
    lengths = {name: duration_of(scene, name) for name in names}
    shortest = max(0.5 / scene.band, LEAST_CELL, sum(lengths.values()) / MOST_CELLS)
    products, each = np.zeros((p, p + 1)), []
    for name in names:
        item, own = _recording(scene, name, shown, weights, max(1, int(lengths[name] / shortest)))
        share = (weights / np.maximum(item.rows, 1.0))[:, None] * item.whole[:, :-1]
        products += own - share.T @ item.whole
        each.append(item)
    return Cells(tuple(each), weights, inverse_of(products[:, :-1]), products[:, -1])


def _recording(
    scene: Scene, name: str, shown: Sequence[int], weights: Array, count: int
) -> tuple[RecordingCells, Array]:
    """Return the cells of a recording, and weighted products of the base model's columns with these and the torque."""
    n, p, k = scene.robot.n, len(scene.value), len(shown)
    squares, across, sums = np.zeros((count, k, k)), np.zeros((count, k, p + 1)), np.zeros((count, n, k))
    whole, rows, products = np.zeros((n, p + 1)), np.zeros(n), np.zeros((p, p + 1))
    duration = duration_of(scene, name)
    for motion, columns in scene.columns.items():
        if motion.name != name:
            continue
        for joint, (time, own) in enumerate(rows_of_last_link(scene, motion, columns, shown)):
            if not len(time):
                continue
            places = np.append(scene.model.active[joint], p)
            size = len(places) - 1
            base, body = own[[*range(size), -1]], own[size:-1]
            # A row is the mean over half a period from its time on.
            share = (time - scene.start[name] + 0.25 / scene.band) / duration
            cells, starts = np.unique(np.clip(count * share, 0, count - 1).astype(int), return_index=True)
            weight = weights[joint]
            products[np.ix_(places[:-1], places)] += weight * (base[:-1] @ base.T)
            whole[joint, places] += np.sum(base, axis=1)
            rows[joint] += len(time)
            sums[cells, joint] += np.add.reduceat(body, starts, axis=1).T
            both = np.concatenate([base, body])
            found = np.zeros((count, k, len(both)))
            for a in range(k):
                found[cells, a] = np.add.reduceat(weight * body[a] * both, starts, axis=1).T
            across[:, :, places] += found[:, :, : len(base)]
            squares += found[:, :, len(base) :]
    bounds = duration * np.linspace(0.0, 1.0, count + 1)
    return RecordingCells(name, bounds, squares, across, sums, whole, rows), products


def duration_of(scene: Scene, name: str) -> float:
    """Return how long a recording is, s."""
    return max(float(item.time[-1]) for item in scene.columns if item.name == name) - scene.start[name]


def inverse_of(products: Array) -> Array:
    """Return the inverse of products of columns, within the directions that they tell."""
    scale = np.sqrt(np.where(np.diag(products) > 0.0, np.diag(products), 1.0))
    return np.asarray(
        np.linalg.pinv(products / np.outer(scale, scale), rcond=_RANK, hermitian=True) / np.outer(scale, scale)
    )
