"""Residuals by frequency, by order of the motor's turn, and by lag."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.spectra import around
from scara_ident.report.traces import Trace
from scara_ident.robot.robot import Robot

ORDER_WORDS = "Within the band only: a ripple whose frequency is above the band is not shown."
SEGMENT_SECONDS = 4.0
LOG_BINS = 260
# Samples per motor turn onto which residuals are gathered, and the highest order shown.
PER_TURN = 64
HIGHEST_ORDER = 16.0
LOWEST_ORDER = 0.5
# A joint that moves its motor by less has no spectrum over orders.
MIN_TURNS = 3.0
# Probability that noise alone crosses the bound at any order, and the width in bins of the median it is scaled to.
FALSE_ALARM = 0.01
MEDIAN_BINS = 41
LONGEST_LAG = 1.5
MAX_LAGS = 120


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Amplitude density over frequency in logarithmic bins: mean and highest, in torque per sqrt(Hz)."""

    frequency: Array
    mean: Array
    highest: Array


def spectrum(signals: Sequence[tuple[Array, float]]) -> Spectrum | None:
    """Return the amplitude density of signals, each with its sample rate; Hann windows with half overlap."""
    usable = [(signal - np.mean(signal), rate) for signal, rate in signals if len(signal) >= 32]
    if not usable:
        return None
    highest = min(rate for _, rate in usable) / 2.0
    total, weight = np.zeros(int(highest * SEGMENT_SECONDS)), 0
    for signal, rate in usable:
        size = round(SEGMENT_SECONDS * rate)
        length = min(size, len(signal))
        window = np.hanning(length)
        pieces = np.lib.stride_tricks.sliding_window_view(signal, length)[:: max(1, length // 2)]
        power = np.sum(np.abs(np.fft.rfft(pieces * window, size, axis=1)) ** 2, axis=0)
        total += 2.0 * power[: len(total)] / (rate * np.sum(window**2))
        weight += len(pieces)
    density = np.sqrt(total[1:] / weight)
    frequency = np.arange(1, len(total)) / SEGMENT_SECONDS
    edges = np.geomspace(frequency[0] * 0.999, frequency[-1] * 1.001, LOG_BINS + 1)
    place = np.searchsorted(edges, frequency) - 1
    kept = np.unique(place)
    starts = np.searchsorted(place, kept)
    count = np.diff([*starts, len(place)])
    return Spectrum(
        np.add.reduceat(frequency, starts) / count,
        np.sqrt(np.add.reduceat(density**2, starts) / count),
        np.maximum.reduceat(density, starts),
    )


@dataclass(frozen=True, eq=False)
class Orders:
    """Amplitude of a residual over orders of the motor's turn, and the bound that noise rarely crosses."""

    order: Array
    amplitude: Array
    bound: Array


def orders(robot: Robot, traces: Sequence[Trace], j: int, residuals: Sequence[Array]) -> Orders | None:
    """Return how much of residuals repeats with the motor's angle.

    The residual is gathered over the motor's angle, whatever the time at which it passed, and transformed; powers
    of recordings are averaged.

    Parameters
    ----------
    j : int
        Joint.
    residuals : sequence of ndarray, shape (N,)
        One per trace.
    """
    turns = [trace.motion.q[j, trace.core] * robot.reduction[j] / (2.0 * np.pi) for trace in traces]
    span = max((float(np.ptp(turn)) for turn in turns if len(turn)), default=0.0)
    if span < MIN_TURNS:
        return None
    length = PER_TURN * int(np.ceil(span) + 1)
    power, weight, parts = np.zeros(length // 2 + 1), 0.0, 0
    for turn, trace, residual in zip(turns, traces, residuals, strict=True):
        if not len(turn) or np.ptp(turn) < MIN_TURNS:
            continue
        values = residual[trace.core]
        # Only samples in motion: a joint at rest would weigh one angle with all its noise.
        moving = trace.used[j, trace.core]
        if np.count_nonzero(moving) < PER_TURN:
            continue
        place = np.floor(turn * PER_TURN).astype(int)
        place -= place.min()
        gathered = np.bincount(place[moving], values[moving] - np.mean(values[moving]), minlength=length)
        count = np.count_nonzero(moving)
        power += count * np.abs(2.0 * np.fft.rfft(gathered, length) / count) ** 2
        weight += count
        parts += 1
    if not parts:
        return None
    order = np.arange(len(power)) * PER_TURN / length
    shown = (order >= LOWEST_ORDER) & (order <= HIGHEST_ORDER)
    # Gathering in bins of a width attenuates by its sinc.
    power = power / weight / np.sinc(order / PER_TURN) ** 2
    return Orders(order[shown], np.sqrt(power[shown]), np.sqrt(_bound(power, parts)[shown]))


def _bound(power: Array, parts: int) -> Array:
    """Bound on noise whose power is a mean of ``parts`` exponential ones, from the median of its neighbours."""
    from scipy.special import gammaincinv

    half, rare = gammaincinv(parts, 0.5), gammaincinv(parts, 1.0 - FALSE_ALARM / len(power))
    return np.asarray(np.median(around(power, min(MEDIAN_BINS, len(power)) // 2), axis=1) * rare / half)


@dataclass(frozen=True, eq=False)
class Autocorrelation:
    """Autocorrelation over lags in s, and the bound of independent samples."""

    lag: Array
    value: Array
    bound: float


def autocorrelation(traces: Sequence[Trace], j: int) -> Autocorrelation | None:
    """Return the autocorrelation of the residual within the band, on the samples that the band leaves independent."""
    first = traces[0]
    step = first.step[j] / first.motion.rate
    lags = max(4, min(MAX_LAGS, int(LONGEST_LAG / step)))
    total, count = np.zeros(lags + 1), np.zeros(lags + 1)
    for trace in traces:
        if abs(trace.step[j] / trace.motion.rate / step - 1.0) > 0.02:
            continue
        used = trace.used[j, :: trace.step[j]].astype(float)
        if np.sum(used) <= lags:
            continue
        signal = used * trace.residual[j, :: trace.step[j]]
        total += _products(signal, lags)
        count += _products(used, lags)
    if count[0] < 0.5 or total[0] <= 0.0:
        return None
    value: Array = (total / np.maximum(count, 1.0)) / (total[0] / count[0])
    return Autocorrelation(
        np.asarray(step * np.arange(lags + 1), dtype=np.float64), value, 1.96 / float(np.sqrt(count[0]))
    )


def _products(signal: Array, lags: int) -> Array:
    size = 2 * len(signal)
    return np.asarray(np.fft.irfft(np.abs(np.fft.rfft(signal, size)) ** 2, size)[: lags + 1], dtype=np.float64)
