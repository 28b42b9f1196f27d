"""Rows of the torque equation: columns and torque of every joint, as they are and within its band."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import Motion, Stretch, differentiate, low_pass, low_pass_every, motion_of, torque_of

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
# velocity's noise: friction is then anything up to Coulomb's. The position's low-pass widens it by this many of its periods.
REST_SHARE = 3e-3
REST_NOISE = 5.0
REST_WIDEN = 0.5
# Both sides of the equation fade out towards rest over this many periods of the position's low-pass.
FADE_PERIODS = 1.0
# Neither is longer than this, s: in a narrow band too little would be left between turning points.
LONGEST_WIDENING = 0.05
# Blocks are long against the band's memory, so that scores of different blocks are nearly independent.
BLOCK_PERIODS = 4.0
BLOCK_SECONDS = 0.5


@dataclass(frozen=True, eq=False)
class Rows:
    """Rows of a stretch: ``[columns; torque]`` per joint, shape (p + 1, N).

    Attributes
    ----------
    motion : Motion
    rest : ndarray of bool, shape (n, N)
        Where each joint stands still, see `standstill`.
    raw : tuple of ndarray
        Before the low-pass.
    banded : tuple of ndarray
        Faded out towards rest, then low-passed: what happens at rest does not reach beyond it.
    """

    motion: Motion
    rest: NDArray[np.bool_]
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
    motion, raw = raw_rows(model, stretch, bands)
    rest = standstill(stretch, motion, bands)
    banded = []
    for rows, active, fade, band in zip(raw, active_rows(model), fading(rest, stretch.rate, bands), bands, strict=True):
        smooth = np.zeros_like(rows)
        smooth[active] = low_pass(fade * rows[active], stretch.rate, band)
        banded.append(smooth)
    return Rows(motion, rest, raw, tuple(banded))


def raw_rows(model: TorqueModel, stretch: Stretch, bands: Sequence[float | None]) -> tuple[Motion, tuple[Array, ...]]:
    """Return the motion that goes with the bands and, per joint, ``[columns; torque]``, shape (p + 1, N)."""
    torque = torque_of(stretch)
    motion = motion_of(stretch, position_cuts(stretch.rate, bands))
    regressor = model.regressor(motion)
    return motion, tuple(np.concatenate([regressor[j], torque[j : j + 1]]) for j in range(len(bands)))


def active_rows(model: TorqueModel) -> list[list[int]]:
    """Return for every joint which of its p + 1 columns can differ from zero; the last is the torque."""
    pattern = model.pattern
    return [[*(int(k) for k in np.flatnonzero(row)), pattern.shape[1]] for row in pattern]


def band_blocks(
    model: TorqueModel,
    stretch: Stretch,
    raw: Sequence[Array],
    rest: NDArray[np.bool_],
    bands: Sequence[float | None],
) -> list[tuple[Array, ...]]:
    """Return the rows within the bands, in blocks of time.

    Of every joint one row is kept per ``row_step`` samples, the others being dependent on them, and weighted to
    stand for all of them.

    Parameters
    ----------
    model : TorqueModel
    stretch : Stretch
    raw : sequence of ndarray, each of shape (p + 1, N)
        See `raw_rows`.
    rest : ndarray of bool, shape (n, N)
        Samples to leave out, see `standstill`.
    bands : sequence of float or None, one per joint

    Returns
    -------
    list of tuple of ndarray, each of shape (k, p + 1)
        Per block and joint.
    """
    count, trim = len(stretch.time), trim_of(stretch, bands)
    length = _block_length(stretch.rate, bands)
    bounds = np.linspace(trim, count - trim, max(1, round((count - 2 * trim) / length)) + 1).astype(int)
    per_joint = []
    fades = fading(rest, stretch.rate, bands)
    for j, (rows, active, band) in enumerate(zip(raw, active_rows(model), bands, strict=True)):
        step = row_step(stretch.rate, band)
        kept = low_pass_every(fades[j] * rows[active], stretch.rate, band, step)
        table = np.zeros((kept.shape[1], rows.shape[0]))
        table[:, active] = np.sqrt(step) * kept.T
        places = step * np.arange(kept.shape[1])
        used = ~rest[j][places]
        per_joint.append([table[used & (places >= start) & (places < stop)] for start, stop in pairwise(bounds)])
    return list(zip(*per_joint, strict=True))


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
    """Return where each joint stands still, shape (n, N), widened by the memory of the position's filter."""
    result = np.zeros(motion.q.shape, dtype=bool)
    for j, band in enumerate(bands):
        v = motion.v[j]
        threshold = max(REST_SHARE * float(np.max(np.abs(v))), REST_NOISE * _velocity_noise(stretch, motion, j, band))
        result[j] = _runs_longer_than(np.abs(v) <= threshold, 1, widen=_widening(REST_WIDEN, stretch.rate, band))
    return result


def fading(rest: NDArray[np.bool_], rate: float, bands: Sequence[float | None]) -> Array:
    """Return the weight of every sample, shape (n, N): 0 at rest, 1 away from it, and between them without a step.

    An equation that holds at every sample holds for both sides times any weight. With the weight zero where friction
    is unknown, the low-pass carries nothing of it to the samples that are used.

    Parameters
    ----------
    rest : ndarray of bool, shape (n, N)
    rate : float
        Samples per second.
    bands : sequence of float or None, one per joint
    """
    result = np.ones(rest.shape)
    for j, band in enumerate(bands):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], rest[j].astype(np.int8), [0]])))
        ramp = _widening(FADE_PERIODS, rate, band)
        rise = np.sin(0.5 * np.pi * np.arange(1, ramp + 1) / (ramp + 1)) ** 2
        for start, stop in edges.reshape(-1, 2):
            before, after = result[j, max(0, start - ramp) : start], result[j, stop : stop + ramp]
            before *= rise[: len(before)][::-1]
            after *= rise[: len(after)]
            result[j, start:stop] = 0.0
    return result


def _widening(periods: float, rate: float, band: float | None) -> int:
    if band is None:
        return 1
    return max(1, int(rate * min(periods / (POSITION_BAND * band), LONGEST_WIDENING)))


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
