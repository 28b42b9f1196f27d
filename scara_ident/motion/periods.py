"""Periods of a motion within one recording, which repeat it as further recordings would."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.motion.motion import Stretch

# Aligned positions that differ by more than this share of their range are not the same motion.
SAME_MOTION = 0.01
# Less than this much of their range apart, on average, positions may be near each other because little time is between.
NEAR_SHARE = 0.1
# A joint's range counts as at least this share of the widest joint's: one that stands still has only noise for a range.
MIN_RANGE_SHARE = 0.01
# Hz at which positions are laid on each other.
FINE_RATE = 100.0
# Share of its last period that a recording may lack.
CUT_SHARE = 0.02
# Distances in time that are looked at closely, the shortest first, and s about each of them.
MAX_LAGS, WINDOW_SECONDS = 6, 0.4


@dataclass(frozen=True)
class Periods:
    """Where a motion repeats within a stretch.

    Attributes
    ----------
    starts : tuple of int
        First sample of each period, two or more.
    length : int
        Samples of each.
    """

    starts: tuple[int, ...]
    length: int


def periods_of(stretch: Stretch) -> Periods | None:
    """Return the whole periods of a stretch of motion; None where there are no two that follow each other.

    Positions are laid on themselves, moved in time. Beginning and end of the stretch may be another motion, as where an arm
    is brought to the path and away from it.

    Parameters
    ----------
    stretch : Stretch
        Uniformly sampled.
    """
    rate = min(FINE_RATE, stretch.rate)
    position = at_rate(stretch, rate)
    spread = np.ptp(position, axis=1)
    if not np.any(spread > 0.0):
        return None
    position /= np.sqrt(len(spread)) * np.maximum(spread, MIN_RANGE_SHARE * np.max(spread))[:, None]
    for near in _lags(position):
        lag = _closest(position, near, round(WINDOW_SECONDS * rate))
        first, stop = _longest(_apart(position, lag) < SAME_MOTION**2)
        # What repeats lasts a period longer than the times at which it does.
        count = int((stop - first) / lag + 1.0 + CUT_SHARE)
        if count >= 2:
            starts = np.rint((first + lag * np.arange(count)) * stretch.rate / rate).astype(int)
            length = min(int(lag * stretch.rate / rate), len(stretch.time) - int(starts[-1]))
            return Periods(tuple(starts.tolist()), length)
    return None


def at_rate(stretch: Stretch, rate: float) -> Array:
    """Return positions at a common rate, shape (n, N), whatever they were sampled at."""
    time = np.arange(stretch.time[0], stretch.time[-1], 1.0 / rate)
    # Samples are uniform, so that no search is needed for those beside a time.
    place = (time - stretch.time[0]) * stretch.rate
    before = np.minimum(place.astype(np.intp), len(stretch.time) - 2)
    share = place - before
    first, second = (stretch.position.take(places, axis=1) for places in (before, before + 1))
    return np.asarray((1.0 - share) * first + share * second)


def _lags(position: Array) -> list[int]:
    """Return by how many samples positions are moved where they lie near themselves, the fewest first."""
    distance = _distances(position)
    away = np.flatnonzero(distance > NEAR_SHARE**2)
    if not len(away):
        return []
    inner = np.arange(max(1, away[0]), len(distance) - 1)
    before, own, after = distance[inner - 1], distance[inner], distance[inner + 1]
    lowest = inner[(own <= before) & (own < after) & (own < np.median(distance[away]))]
    # The way to the path and back moves the minimum, but most of the motion lies near itself there all the same.
    return [int(lag) for lag in lowest if np.median(_apart(position, lag)) < NEAR_SHARE**2][:MAX_LAGS]


def _closest(position: Array, lag: int, beside: int) -> float:
    """Return the lag about one, between samples, at which most of the motion lies closest to itself."""
    last = position.shape[1] - 3
    for step in (max(1, beside // 8), 1):
        reach = beside if step > 1 else max(1, beside // 8)
        lags = np.arange(max(2, lag - reach), min(last, lag + reach) + 1, step)
        lag = int(lags[int(np.argmin([np.median(_apart(position, item)) for item in lags]))])
    # The squared distance is a parabola of the lag.
    low, middle, high = (float(np.median(_apart(position, item))) for item in (lag - 1, lag, lag + 1))
    bend = low + high - 2.0 * middle
    return lag + (float(np.clip(0.5 * (low - high) / bend, -0.5, 0.5)) if bend > 0.0 else 0.0)


def _distances(position: Array) -> Array:
    """Return the mean squared distance of positions, shape (n, N), from themselves moved by 0 to N/2 samples."""
    from scipy.fft import next_fast_len

    centred = position - position.mean(axis=1, keepdims=True)
    count = position.shape[1]
    padded = next_fast_len(2 * count, real=True)
    spectrum = np.fft.rfft(centred, padded, axis=1)
    lags = np.arange(count // 2 + 1)
    product = np.fft.irfft(np.sum(np.abs(spectrum) ** 2, axis=0), padded)[lags]
    square = np.concatenate([[0.0], np.cumsum(np.sum(centred**2, axis=0))])
    total = square[count - lags] + square[count] - square[lags] - 2.0 * product
    return np.asarray(np.maximum(total, 0.0) / (count - lags))


def _apart(position: Array, lag: float) -> Array:
    """Return the squared distance of each sample from that a lag later."""
    whole, part = int(lag), lag - int(lag)
    count = position.shape[1] - whole - 1
    later = (1.0 - part) * position[:, whole : whole + count] + part * position[:, whole + 1 : whole + 1 + count]
    return np.asarray(np.sum((later - position[:, :count]) ** 2, axis=0))


def _longest(flags: NDArray[np.bool_]) -> tuple[int, int]:
    """Return where the longest run of true begins, and the place after its end."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    if not len(edges):
        return 0, 0
    runs = edges.reshape(-1, 2)
    first, stop = runs[int(np.argmax(runs[:, 1] - runs[:, 0]))]
    return int(first), int(stop)
