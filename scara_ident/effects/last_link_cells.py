"""Information of short cells of time on a body on the last link, beside the base model and per-recording offsets.

Of each cell only products of the body's columns are kept, and of all recordings together those of the base model: nothing
grows with the number of samples, and with the number of cells only what a body's few columns need.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.recording_groups import half_periods, inverse_of, means_of, rows_of_last_link
from scara_ident.effects.signals import Scene, Signals

# Cells last this long at the least, s, a sixth of what is carried shortest, and there are so many in all recordings together:
# more would tell instants better, and take more time and memory than they are worth here.
MIN_CELL, MAX_CELLS = 0.05, 8192


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
        """Return the normal equations of bodies that act in some cells, the base model and offsets taken off.

        Parameters
        ----------
        states : sequence of ndarray, each of shape (..., C)
            How much of each cell of a recording they act in.

        Returns
        -------
        tuple of ndarray
            Products (..., k, k), right sides (..., k), and products with the base model (..., k, p).
        """
        squares, across = np.zeros(()), np.zeros(())
        for item, state in zip(self.each, states, strict=True):
            inside = np.tensordot(state, item.sums, 1)
            share = ((self.weights / np.maximum(item.rows, 1.0))[:, None] * inside).swapaxes(-1, -2)
            squares = squares + np.tensordot(state, item.squares, 1) - share @ inside
            across = across + np.tensordot(state, item.across, 1) - share @ item.whole
        reach, right = across[..., :-1], across[..., -1]
        return squares - reach @ self.inverse @ reach.swapaxes(-1, -2), right - reach @ (self.inverse @ self.aim), reach

    def scores(self, states: Sequence[Array], reach: Array, body: Array) -> tuple[list[Array], list[Array]]:
        """Return what cells say of bodies where they act as given and all else is fitted beside them.

        Parameters
        ----------
        states : sequence of ndarray, each of shape (..., C)
        reach : ndarray, shape (..., k, p)
            Products with the base model, see `normal`.
        body : ndarray, shape (..., k)

        Returns
        -------
        tuple of list of ndarray
            Of each recording the products of what the body makes in a cell with what is left there without it, and its
            squares, (..., C) each.
        """
        value = (self.aim - (body[..., None, :] @ reach)[..., 0, :]) @ self.inverse
        full = np.concatenate([-value, np.ones((*value.shape[:-1], 1))], axis=-1)
        seen, made = [], []
        for item, state in zip(self.each, states, strict=True):
            inside = (np.tensordot(state, item.sums, 1) @ body[..., None])[..., 0]
            offset = self.weights * (full @ item.whole.T - inside) / np.maximum(item.rows, 1.0)
            seen.append(_of_cells(item.across, body, full) - _of_cells(item.sums, offset, body))
            made.append(_of_cells(item.squares, body, body))
        return seen, made


def _of_cells(table: Array, one: Array, other: Array) -> Array:
    """Return what tables (C, a, b) are between vectors (..., a) and (..., b), shape (..., C)."""
    both = (one[..., :, None] * other[..., None, :]).reshape(*one.shape[:-1], -1)
    return np.asarray(both @ table.reshape(len(table), -1).T)


def cells_of(scene: Scene, shown: Sequence[int]) -> Cells:
    """Return what cells of recordings say of a body on the last link.

    Parameters
    ----------
    scene : Scene
        With the base model's columns on motions that carry the recorded torque, and its estimate by them.
    shown : sequence of int
        Standard parameters of the body.
    """
    p, weights = len(scene.value), _weights(scene)
    with_motion = {motion.name for motion in scene.columns}
    lengths = {name: duration_of(scene, name) for name in scene.start if name in with_motion}
    shortest = max(0.5 / scene.band, MIN_CELL, sum(lengths.values()) / MAX_CELLS)
    products, each = np.zeros((p, p + 1)), []
    for name, length in lengths.items():
        item, own = _recording(scene, name, shown, weights, max(1, int(length / shortest)))
        share = (weights / np.maximum(item.rows, 1.0))[:, None] * item.whole[:, :-1]
        products += own - share.T @ item.whole
        each.append(item)
    return Cells(tuple(each), weights, inverse_of(products[:, :-1]), products[:, -1])


def _weights(scene: Scene) -> Array:
    """Return one over what the base model and offsets of recordings leave of a row of each joint, squared, shape (n,)."""
    n = scene.robot.n
    whole, count, squares = np.zeros(n), np.zeros(n), np.zeros(n)
    # Of each recording the sums of what is left, and of ones.
    sums: dict[str, Array] = {}
    for motion in scene.columns:
        if motion.torque is None:
            continue
        step, _, sure = half_periods(scene, motion)
        means = means_of(motion.torque - Signals(scene, motion).predicted, step)
        own = sums.setdefault(motion.name, np.zeros((2, n)))
        own += np.sum(np.array([means, np.ones_like(means)]) * sure, axis=2)
        squares += np.sum(sure * means**2, axis=1)
        whole += np.sum(motion.torque**2, axis=1)
    for total, rows in sums.values():
        squares -= total**2 / np.maximum(rows, 1.0)
        count += rows
    return np.asarray(count / np.maximum(squares, np.finfo(float).eps * whole + np.finfo(float).tiny))


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
        time, sure, own = rows_of_last_link(scene, motion, columns, shown)
        if not len(time):
            continue
        base, body = own[:, [*range(p), -1]], own[:, p:-1]
        products += np.sum(weights[:, None, None] * (base[:, :-1] @ base.swapaxes(1, 2)), axis=0)
        whole += np.sum(base, axis=2)
        rows += np.sum(sure, axis=1)
        # A row is the mean over half a period from its time on.
        share = (time - scene.start[name] + 0.25 / scene.band) / duration
        cells, starts = np.unique(np.clip(count * share, 0, count - 1).astype(int), return_index=True)
        # Rows first: so they are summed fast.
        base, body = (np.ascontiguousarray(np.moveaxis(part, 2, 0)) for part in (base, body))
        weighted = np.swapaxes(weights[:, None] * body, 1, 2)
        for table, part in ((sums, body), (squares, weighted @ body), (across, weighted @ base)):
            table[cells] += np.add.reduceat(part, starts, axis=0)
    bounds = duration * np.linspace(0.0, 1.0, count + 1)
    return RecordingCells(name, bounds, squares, across, sums, whole, rows), products


def duration_of(scene: Scene, name: str) -> float:
    """Return how long a recording is, s."""
    return max(float(item.time[-1]) for item in scene.columns if item.name == name) - scene.start[name]
