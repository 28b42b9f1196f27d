"""What a recording says of a model: one triangular factor per joint and block of time.

The rows of a recording are made twice from the same motion: in the band, where columns and torque pass the same
low-pass and every row that the band leaves independent is kept; and unfiltered, where the recorded torque is
taken as it is. Stretches of samples are generated, absorbed and forgotten.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scara_ident.errors import RecordingError
from scara_ident.estimation.information import Information, merge
from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import stretches
from scara_ident.motion.prepared import band_blocks, raw_rows, row_step, standstill, trim_of
from scara_ident.recording.recording import Recording
from scara_ident.threads import one_blas_thread


@dataclass(frozen=True, eq=False)
class Evidence:
    """The information that one recording holds on a model.

    Attributes
    ----------
    recording, trajectory : str
    samples : int
        Samples of the recording on its uniform time grid.
    blocks : tuple of tuple of Information
        ``blocks[b][j]``: rows of joint j within the band in block b of time. Each row is weighted to stand for
        all samples that the band makes dependent on it, so that ``rows`` counts samples.
    unfiltered : tuple of Information
        Per joint, all samples, the recorded torque without any filter.
    row_step : tuple of int
        Per joint, how many samples one row of the band stands for.
    left_out_ends : float
        Seconds left out at the ends of its stretches.
    left_out_rest : tuple of float
        Per joint, share of the remaining samples left out because the joint stood still.
    """

    recording: str
    trajectory: str
    samples: int
    blocks: tuple[tuple[Information, ...], ...]
    unfiltered: tuple[Information, ...]
    row_step: tuple[int, ...]
    left_out_ends: float
    left_out_rest: tuple[float, ...]

    @cached_property
    def joints(self) -> tuple[Information, ...]:
        """All rows of each joint within the band."""
        return tuple(merge(block[j] for block in self.blocks) for j in range(len(self.unfiltered)))

    def joint(self, joint: int) -> Information:
        """Return all rows of one joint within the band."""
        return self.joints[joint]


def gather(model: TorqueModel, recording: Recording, bands: Sequence[float | None]) -> Evidence:
    """Make the rows of a recording and absorb them.

    Parameters
    ----------
    model : TorqueModel
    recording : Recording
        With effort.
    bands : sequence of float or None, one per joint
        Cut-off of the low-pass on both sides of each joint's equation in Hz; None filters nothing.

    Returns
    -------
    Evidence

    Raises
    ------
    RecordingError
        If no row is left.
    """
    size = len(model.columns)
    blocks: list[tuple[Information, ...]] = []
    unfiltered = [Information.empty(size) for _ in range(model.robot.n)]
    samples, ends, used, rested = 0, 0.0, np.zeros(model.robot.n), np.zeros(model.robot.n)
    steps = [1] * model.robot.n
    for stretch in stretches(recording):
        samples += len(stretch.time)
        trim = trim_of(stretch, bands)
        ends += min(2 * trim, len(stretch.time)) / stretch.rate
        if len(stretch.time) <= 2 * trim + 1:
            continue
        motion, raw = raw_rows(model, stretch, bands)
        rest = standstill(stretch, motion, bands)
        steps = [row_step(stretch.rate, band) for band in bands]
        for j in range(model.robot.n):
            keep = ~rest[j]
            keep[:trim] = keep[-trim:] = False
            used[j] += np.count_nonzero(keep)
            rested[j] += np.count_nonzero(rest[j][trim : len(keep) - trim])
            unfiltered[j] = unfiltered[j].absorb_columns(raw[j][:, keep])
        for block in band_blocks(model, stretch, raw, rest, bands):
            blocks.append(tuple(_absorbed(rows, step) for rows, step in zip(block, steps, strict=True)))
    if not blocks or not np.any(used):
        raise RecordingError(
            f"{recording.path or recording.name}: nothing is left of {samples} samples once the ends and the times "
            "at rest are left out; record longer or moving data"
        )
    share = rested / np.maximum(used + rested, 1.0)
    return Evidence(
        recording.name,
        recording.trajectory,
        samples,
        tuple(blocks),
        tuple(unfiltered),
        tuple(steps),
        ends,
        tuple(float(x) for x in share),
    )


def _absorbed(rows: np.ndarray, step: int) -> Information:
    information = Information.empty(rows.shape[1] - 1).absorb_columns(rows.T)
    return Information(information.factor, step * information.rows)


def gather_all(
    model: TorqueModel, recordings: Sequence[Recording], bands: Sequence[float | None]
) -> tuple[Evidence, ...]:
    """Make the rows of several recordings, two at a time; see `gather`."""
    with one_blas_thread(), ThreadPoolExecutor(max_workers=2) as pool:
        return tuple(pool.map(lambda recording: gather(model, recording, bands), recordings))
