"""The rows of all recordings, within the band, as one table: columns are added, never made twice."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scara_ident.diagnosis.candidates import Bank, Candidate
from scara_ident.effects import Scene
from scara_ident.estimation.information import triangular
from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import stretches
from scara_ident.motion.prepared import band_blocks, raw_rows, standstill, trim_of
from scara_ident.recording.recording import Recording
from scara_ident.threads import one_blas_thread

Array = NDArray[np.float64]

# Folds where there is one trajectory only: consecutive parts of it.
PARTS = 4


@dataclass(frozen=True, eq=False)
class Table:
    """Rows of all recordings with the blocks of time they belong to.

    Attributes
    ----------
    columns : ndarray, shape (N, P)
    torque : ndarray, shape (N,)
    joint : ndarray of int, shape (N,)
        Joint of each row.
    starts : ndarray of int
        Where each block begins; the rows of all joints of a block follow each other.
    recording : ndarray of int
        Recording of each block.
    fold_names : tuple of str
        Trajectories, or parts of the only one.
    fold : ndarray of int
        Fold of each block.
    """

    columns: Array
    torque: Array
    joint: NDArray[np.intp]
    starts: NDArray[np.intp]
    recording: NDArray[np.intp]
    fold_names: tuple[str, ...]
    fold: NDArray[np.intp]

    def weighted(self, weights: Array) -> Table:
        """Return the table with each joint's rows multiplied by its weight."""
        size = weights[self.joint]
        return replace(self, columns=self.columns * size[:, None], torque=self.torque * size)

    def beside(self, columns: Array) -> Table:
        """Return the table with further columns behind its own."""
        return replace(self, columns=np.hstack([self.columns, columns]))

    @cached_property
    def rows(self) -> Array:
        """Columns and torque, shape (N, P + 1)."""
        return np.column_stack([self.columns, self.torque])

    @cached_property
    def fold_factors(self) -> tuple[Array, ...]:
        """Triangular factor of the rows of each fold."""
        of_row = np.repeat(self.fold, np.diff([*self.starts, len(self.torque)]))
        with one_blas_thread():
            return tuple(triangular(self.rows[of_row == k]) for k in range(len(self.fold_names)))

    @cached_property
    def whole(self) -> Array:
        """Triangular factor of all rows."""
        with one_blas_thread():
            return triangular(np.vstack(self.fold_factors))


def tabulate(model: TorqueModel, recordings: Sequence[Recording], bands: Sequence[float | None]) -> Table:
    """Make the rows of all recordings within the bands.

    Parameters
    ----------
    model : TorqueModel
    recordings : sequence of Recording
    bands : sequence of float or None, one per joint
    """
    with one_blas_thread(), ThreadPoolExecutor(max_workers=2) as pool:
        parts = list(pool.map(lambda recording: _blocks_of(model, recording, bands), recordings))
    rows: list[Array] = []
    joint: list[NDArray[np.intp]] = []
    starts: list[int] = []
    owner: list[int] = []
    total = 0
    for place, blocks in enumerate(parts):
        for block in blocks:
            count = sum(len(part) for part in block)
            if not count:
                continue
            starts.append(total)
            owner.append(place)
            total += count
            rows += block
            joint += [np.full(len(part), j) for j, part in enumerate(block)]
    names = list(dict.fromkeys(recording.trajectory for recording in recordings))
    fold = np.array([names.index(recordings[k].trajectory) for k in owner], dtype=np.intp)
    if len(names) == 1:
        names = [f"part {k + 1}" for k in range(PARTS)]
        fold = np.minimum(np.arange(len(starts)) * PARTS // max(1, len(starts)), PARTS - 1)
    table = np.vstack(rows)
    return Table(
        table[:, :-1], table[:, -1], np.concatenate(joint), np.array(starts), np.array(owner), tuple(names), fold
    )


def _blocks_of(model: TorqueModel, recording: Recording, bands: Sequence[float | None]) -> list[tuple[Array, ...]]:
    found: list[tuple[Array, ...]] = []
    for stretch in stretches(recording):
        if len(stretch.time) <= 2 * trim_of(stretch, bands) + 1:
            continue
        motion, raw = raw_rows(model, stretch, bands)
        found += band_blocks(model, stretch, raw, standstill(stretch, motion, bands), bands)
    return found


def tabulate_candidates(
    scene: Scene, candidates: Sequence[Candidate], recordings: Sequence[Recording], bands: Sequence[float | None]
) -> tuple[Array, tuple[slice, ...]]:
    """Make the columns of candidates on the rows of `tabulate`.

    Returns
    -------
    columns : ndarray, shape (N, k)
    places : tuple of slice
        Where each candidate's columns stand.
    """
    bank = Bank(scene, tuple(candidates))
    return tabulate(TorqueModel("candidates", scene.robot, (bank,)), recordings, bands).columns, bank.places
