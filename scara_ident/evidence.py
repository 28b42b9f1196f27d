"""What a recording says of a model: one triangular factor per joint and block of time.

The rows of a recording are made twice from the same motion: in the band, where columns and torque pass the same
low-pass and every row that the band leaves independent is kept; and unfiltered, where the recorded torque is
taken as it is. Chunks of samples are generated, absorbed and forgotten.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scara_ident.errors import RecordingError
from scara_ident.information import Information, merge
from scara_ident.model import TorqueModel
from scara_ident.motion import Motion, Stretch, differentiate, low_pass, motion_of, stretches, torque_of
from scara_ident.recording import Recording
from scara_ident.threads import one_blas_thread

Array = NDArray[np.float64]

# Positions pass a filter three times as wide as the band: inside the band it then changes them by under 2e-4.
POSITION_BAND = 3.0
# Rows per period of the band that are kept: the filter lets little through above 1.25 of its cut-off.
ROWS_PER_PERIOD = 2.5
# Periods of the band left out at both ends of a stretch, where the filter's continuation is a guess, and the least
# number of samples, where an unfiltered derivative rings.
END_PERIODS = 1.0
END_SAMPLES = 20
# A rate is known to rounding only; what is a whole number but for that is one.
ROUNDING = 1e-9
# A joint stands still where its speed stays below this share of its peak, or below this many standard deviations of its
# velocity's noise, for longer than this many periods of the band: friction is then anything up to Coulomb's.
REST_SHARE = 3e-3
REST_NOISE = 5.0
REST_PERIODS = 0.05
# Blocks are long against the band's memory, so that scores of different blocks are nearly independent.
BLOCK_PERIODS = 4.0
BLOCK_SECONDS = 0.5


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

    def joint(self, joint: int) -> Information:
        """Return all rows of one joint within the band."""
        return merge(block[joint] for block in self.blocks)


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
        rows = rows_of(model, stretch, bands)
        rest = standstill(stretch, rows.motion, bands)
        steps = [row_step(stretch.rate, band) for band in bands]
        for j in range(model.robot.n):
            keep = ~rest[j]
            keep[:trim] = keep[-trim:] = False
            used[j] += np.count_nonzero(keep)
            rested[j] += np.count_nonzero(rest[j][trim : len(keep) - trim])
            unfiltered[j] = unfiltered[j].absorb_columns(rows.raw[j][:, keep])
        blocks += _blocks(rows, rest, trim, steps, _block_length(stretch.rate, bands))
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


def gather_all(
    model: TorqueModel, recordings: Sequence[Recording], bands: Sequence[float | None]
) -> tuple[Evidence, ...]:
    """Make the rows of several recordings, two at a time; see `gather`."""
    with one_blas_thread(), ThreadPoolExecutor(max_workers=2) as pool:
        return tuple(pool.map(lambda recording: gather(model, recording, bands), recordings))


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of a stretch: ``[columns; torque]`` per joint, shape (p + 1, N), before and after the low-pass."""

    motion: Motion
    raw: tuple[Array, ...]
    banded: tuple[Array, ...]


def rows_of(model: TorqueModel, stretch: Stretch, bands: Sequence[float | None]) -> Rows:
    """Return the rows of a stretch on its whole time grid.

    Parameters
    ----------
    model : TorqueModel
    stretch : Stretch
        With torque.
    bands : sequence of float or None, one per joint

    Returns
    -------
    Rows
    """
    torque = torque_of(stretch)
    motion = motion_of(stretch, position_cuts(stretch.rate, bands))
    regressor = model.regressor(motion)
    raw, banded = [], []
    for j, band in enumerate(bands):
        rows = np.concatenate([regressor[j], torque[j : j + 1]])
        active = [*np.flatnonzero(model.pattern[j]), rows.shape[0] - 1]
        smooth = np.zeros_like(rows)
        smooth[active] = low_pass(rows[active], stretch.rate, band)
        raw.append(rows)
        banded.append(smooth)
    return Rows(motion, tuple(raw), tuple(banded))


def position_cuts(rate: float, bands: Sequence[float | None]) -> list[float | None]:
    """Return the cut-offs of the positions that go with the bands; None where that is beyond half the rate."""
    return [None if band is None or POSITION_BAND * band > 0.45 * rate else POSITION_BAND * band for band in bands]


def row_step(rate: float, band: float | None) -> int:
    """Return how many samples one row stands for in a band."""
    return 1 if band is None else max(1, int(rate / (ROWS_PER_PERIOD * band) * (1.0 + ROUNDING)))


def trim_of(stretch: Stretch, bands: Sequence[float | None]) -> int:
    """Return how many samples are left out at each end of a stretch."""
    slowest = min((band for band in bands if band is not None), default=np.inf)
    return max(END_SAMPLES, int(np.ceil(END_PERIODS * stretch.rate / slowest * (1.0 - ROUNDING))))


def _block_length(rate: float, bands: Sequence[float | None]) -> int:
    slowest = min((band for band in bands if band is not None), default=np.inf)
    return max(1, int(rate * max(BLOCK_SECONDS, BLOCK_PERIODS / slowest) * (1.0 + ROUNDING)))


def standstill(stretch: Stretch, motion: Motion, bands: Sequence[float | None]) -> NDArray[np.bool_]:
    """Return where each joint stands still, shape (n, N), widened by the filter's memory."""
    result = np.zeros(motion.q.shape, dtype=bool)
    for j, band in enumerate(bands):
        v = motion.v[j]
        threshold = max(REST_SHARE * float(np.max(np.abs(v))), REST_NOISE * _velocity_noise(stretch, motion, j, band))
        span = 1 if band is None else max(1, int(REST_PERIODS * stretch.rate / band))
        result[j] = _runs_longer_than(np.abs(v) <= threshold, span, widen=span)
    return result


def _velocity_noise(stretch: Stretch, motion: Motion, joint: int, band: float | None) -> float:
    """Return the standard deviation of the filtered velocity's noise, from what the filter took out of the position.

    White position noise of density s/rate integrates to ``s (2 pi)^2 f^3 / 3`` in velocity up to f.
    """
    cut = position_cuts(stretch.rate, [band])[0] or 0.45 * stretch.rate
    if band is None:
        # Nothing was filtered; the noise is what a wide filter would take out.
        cut = 0.2 * stretch.rate
        smooth = differentiate(stretch.position[joint], stretch.rate, cut)[0]
    else:
        smooth = motion.q[joint]
    rest = stretch.position[joint] - smooth
    # The median ignores the moments at which real motion is faster than the filter.
    scatter = float(np.median(np.abs(rest))) / 0.6745
    nyquist = 0.5 * stretch.rate
    removed = max(nyquist - cut, 0.1 * nyquist)
    return float(scatter / np.sqrt(removed) * 2.0 * np.pi * np.sqrt(cut**3 / 3.0))


def _runs_longer_than(mask: NDArray[np.bool_], length: int, widen: int) -> NDArray[np.bool_]:
    """Keep the runs of True that are longer than ``length`` and widen them by ``widen`` on both sides."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(np.int8), [0]])))
    result = np.zeros_like(mask)
    for start, stop in edges.reshape(-1, 2):
        if stop - start > length:
            result[max(0, start - widen) : stop + widen] = True
    return result


def _blocks(
    rows: Rows, rest: NDArray[np.bool_], trim: int, steps: Sequence[int], length: int
) -> list[tuple[Information, ...]]:
    count = rest.shape[1]
    pieces = max(1, round((count - 2 * trim) / length))
    bounds = np.linspace(trim, count - trim, pieces + 1).astype(int)
    found = []
    for start, stop in pairwise(bounds):
        block = []
        for j, step in enumerate(steps):
            # The grid of kept rows runs through the blocks, whatever their bounds.
            places = np.arange(start + (-start) % step, stop, step)
            places = places[~rest[j][places]]
            columns = rows.banded[j][:, places]
            info = Information.empty(columns.shape[0] - 1).absorb_columns(columns)
            block.append(Information(np.sqrt(step) * info.factor, step * info.rows))
        found.append(tuple(block))
    return found
