"""Zero-phase low-pass and derivatives.

One filter serves all: the squared magnitude of a fourth-order Butterworth low-pass, 1 / (1 + (f/fc)^8), applied
in the frequency domain to the signal continued by odd reflection. It has no phase, and derivatives are taken in
the same step, exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array

# Cut-off over sample rate above which a low-pass is left out: it would take off next to nothing.
HIGHEST_CUT = 0.45
# The filter's memory in periods of its cut-off: 4 of them leave under 1e-4 of a step.
MEMORY_PERIODS = 4.0
# A low-passed signal has nothing beyond this many times its cut-off, where the filter would leave 6e-8.
HIGHEST_RATIO = 8.0
# Integral of its squared gain over frequency, in cut-offs: of 1 / (1 + x^8)^2 from 0 on.
NOISE_WIDTH = 7.0 * np.pi / (64.0 * np.sin(np.pi / 8.0))
# Of so many frequencies a mean over the filter's slope is that of all to a thousandth.
FREQUENCIES = 2001
# Signals that are transformed together: of more the memory leaves the cache, of fewer the calls take longer.
ROWS_AT_ONCE = 8


def low_pass(signal: Array, rate: float, cut: float | None, step: int = 1) -> Array:
    """Low-pass a signal without phase.

    Parameters
    ----------
    signal : ndarray, shape (..., N)
    rate : float
        Samples per second.
    cut : float or None
        Frequency in Hz where half the amplitude is left; None leaves the signal as it is.
    step : int, optional
        Of `low_pass_every`, to continue the signal to the same length, so that both agree to rounding.

    Returns
    -------
    ndarray, shape (..., N)
    """
    if cut is None:
        return signal
    return np.asarray(_filtered(signal, rate, cut, (0,), HIGHEST_RATIO * cut, step)[0])


def noise_share(rate: float, cut: float | None) -> float:
    """Return the share of the variance of white noise that `low_pass` leaves."""
    return 1.0 if cut is None else min(1.0, 2.0 * NOISE_WIDTH * cut / rate)


def removed_share(rate: float, cut: float) -> float:
    """Return the share of the variance of white noise in what `low_pass` takes out of it."""
    gain = 1.0 / (1.0 + (np.linspace(0.0, 0.5 * rate / cut, FREQUENCIES)) ** 8)
    return float(np.mean((1.0 - gain) ** 2))


def low_pass_every(signal: Array, rate: float, cut: float | None, step: int, weight: Array | None = None) -> Array:
    """Return every ``step``-th sample of `low_pass`, from the first on, without computing the others.

    What leaving out samples does to the spectrum is in the gains, so that the result is the same to rounding if `low_pass`
    is given the step.

    Parameters
    ----------
    signal : ndarray, shape (k, N)
    rate : float
        Samples per second.
    cut : float or None
        Frequency in Hz where half the amplitude is left; None filters nothing.
    weight : ndarray, shape (N,) or (k, N), optional
        The signal is multiplied by it first.

    Returns
    -------
    ndarray, shape (k, ceil(N / step))
    """
    if cut is None or step == 1:
        return low_pass(signal if weight is None else weight * signal, rate, cut)[..., ::step]
    count = signal.shape[-1]
    phases = _phases(count, rate / cut, step)
    reach, first, low, kept = phases.reach, phases.first, phases.low, phases.of_chord.shape[1]
    whole = count // step * step
    size = np.broadcast_to(1.0 if weight is None else weight, signal.shape)
    start, stop = (signal[:, part] * size[:, part] for part in (slice(reach + 1), slice(count - reach - 1, count)))
    before, after = 2.0 * start[:, :1] - start[:, :0:-1], 2.0 * stop[:, -1:] - stop[:, -2::-1]
    ends = np.hstack([before, stop[:, reach + 1 - count + whole :], after])
    # Without its chord the continued signal closes on itself; what the filter does to the chord is known.
    slope = (after[:, -1:] - before[:, :1]) / (count - 1 + 2 * reach)
    result = np.hstack([before[:, :1], slope]) @ phases.of_chord
    sizes = _by_phase(size[:, :whole], step)
    if weight is None or weight.ndim == 1:
        # Put in that order once: to read both signal and weight out of order takes twice as long as one.
        sizes = np.broadcast_to(np.ascontiguousarray(sizes[:1]), sizes.shape)
    # By phase, as the transform takes them; what no sample is written to is zero.
    buffer = np.empty((min(ROWS_AT_ONCE, len(signal)), step, low))
    buffer[:, :, :first] = buffer[:, :, first + whole // step :] = 0.0
    spectra = np.empty((*buffer.shape[:2], low // 2 + 1), dtype=complex)
    for begin in range(0, len(signal), ROWS_AT_ONCE):
        some = slice(begin, begin + ROWS_AT_ONCE)
        parts = buffer[: len(signal) - begin]
        spectrum = spectra[: len(parts)]
        middle = parts[:, :, first : first + whole // step]
        np.multiply(_by_phase(signal[some, :whole], step), sizes[some], out=middle)
        parts[:, phases.ends[0], phases.ends[1]] = ends[some]
        np.fft.rfft(parts, axis=2, out=spectrum)
        spectrum *= phases.gains
        result[some] += np.fft.irfft(np.add.reduce(spectrum, axis=1), low, axis=1)[:, first : first + kept]
    return np.asarray(result)


def low_pass_between(signal: Array, rate: float, cut: float, step: int, every: int, weight: Array) -> Array:
    """Return every ``step``-th sample of `low_pass`, of a signal that is given at every ``every``-th only.

    Between the given samples the low-passed signal is known, as it holds nothing beyond half their rate.

    Parameters
    ----------
    signal : ndarray, shape (k, N)
    rate : float
        Samples per second that ``step`` and ``every`` count.
    cut : float
        Frequency in Hz where half the amplitude is left, well below half the rate of the given samples.
    weight : ndarray, shape (N,)
        The signal is multiplied by it first.

    Returns
    -------
    ndarray, shape (k, ceil(((N - 1) every + 1) / step))
    """
    if step % every == 0:
        return low_pass_every(signal, rate / every, cut, step // every, weight)
    count = signal.shape[-1]
    reach, closed, low, gains = _between(count, rate / cut, step, every)
    kept = -(-((count - 1) * every + 1) // step)
    result = np.empty((len(signal), kept))
    whole = np.zeros((min(ROWS_AT_ONCE, len(signal)), closed))
    for begin in range(0, len(signal), ROWS_AT_ONCE):
        some = weight * signal[begin : begin + ROWS_AT_ONCE]
        flat = whole[: len(some)]
        ramp, slope = _continue(some, reach, flat[:, : count + 2 * reach])
        smooth = np.fft.irfft(np.fft.rfft(flat, axis=1)[:, : len(gains)] * gains, low, axis=1)
        chord = ramp[:, reach : reach + 1] + slope * (np.arange(kept) * (step / every))
        result[begin : begin + ROWS_AT_ONCE] = smooth[:, :: low // (closed * every // step)][:, :kept] + chord
    return result


@lru_cache(maxsize=24)
def _between(count: int, ratio: float, step: int, every: int) -> tuple[int, int, int, NDArray[np.complexfloating]]:
    """Return samples that continue a signal, and of it and of what is low-passed the lengths, and the gains from the first sample on."""
    reach = min(count - 1, int(np.ceil(MEMORY_PERIODS * ratio / every)) + 1)
    closed = _closed_length(count, reach, step)
    kept = closed * every // step
    frequency = np.arange(min(closed // 2, int(HIGHEST_RATIO * closed * every / ratio)) + 1) * (
        ratio / (closed * every)
    )
    # As many times the kept samples as hold every frequency.
    low = kept * int(np.ceil(2.0 * len(frequency) / kept))
    gain = low / closed / (1.0 + frequency**8)
    return reach, closed, low, gain * np.exp(2j * np.pi * reach / closed * np.arange(len(frequency)))


def _by_phase(signals: Array, step: int) -> Array:
    """Return signals, shape (..., N), as those of each phase, shape (..., step, N / step): every step-th sample from it on."""
    return signals.reshape(*signals.shape[:-1], signals.shape[-1] // step, step).swapaxes(-1, -2)


@dataclass(frozen=True, eq=False)
class _Phases:
    """How each phase of a continued signal, its every step-th sample from the phase on, enters the filtered at that rate.

    A filter followed by leaving out samples is the sum of filters of the phases (Vaidyanathan, *Multirate Systems and Filter
    Banks*, 1993, section 4.3), whose transforms are short.

    Attributes
    ----------
    reach : int
        Samples that continue the signal at either end.
    first, low : int
        Kept samples from the start to the signal's first, and in all.
    ends : tuple of ndarray of int, shape (k,)
        Phase and place of what is before the signal, and of what is after its last whole step.
    gains : ndarray, shape (step, low // 2 + 1)
        Of each phase.
    of_chord : ndarray, shape (2, kept)
        What is missing of a constant 1 and of the number of the sample, each over the continued signal and zero beyond.
    """

    reach: int
    first: int
    low: int
    ends: tuple[NDArray[np.intp], NDArray[np.intp]]
    gains: NDArray[np.complexfloating]
    of_chord: Array


# Gains are as large as a signal.
@lru_cache(maxsize=24)
def _phases(count: int, ratio: float, step: int) -> _Phases:
    """Return how signals of so many samples are low-passed at the sample rate over a ratio, and every step-th is kept."""
    reach = min(count - 1, int(np.ceil(MEMORY_PERIODS * ratio)) + 1)
    # The first sample must fall on the lower grid.
    lead = -(-reach // step) * step
    closed = _closed_length(count, reach, step)
    low = closed // step
    frequency = np.arange(min(closed // 2, int(HIGHEST_RATIO * closed / ratio)) + 1) * (ratio / closed)
    gain = np.asarray(1.0 / (step * (1.0 + frequency**8)), dtype=float)
    # Half the rate is its own mirror image.
    gain[2 * np.arange(len(frequency)) == closed] *= 0.5
    phase, place = np.arange(step)[:, None], np.arange(low // 2 + 1)
    gains = np.zeros((step, len(place)), dtype=complex)
    # Leaving out samples folds every frequency that is a multiple of the lower rate away.
    for fold in range(-(len(gain) // low) - 1, len(gain) // low + 1):
        number = np.abs(place + fold * low)
        size = np.where(number < len(gain), gain[np.minimum(number, len(gain) - 1)], 0.0)
        gains += size * np.exp(-2j * np.pi / step * (phase * fold % step))
    gains *= np.exp(-2j * np.pi / closed * (phase * place))
    kept, whole = -(-count // step), count // step * step
    outside = np.r_[lead - reach : lead, lead + whole : lead + count + reach]
    lines = np.zeros((2, closed))
    lines[:, lead - reach : lead + count + reach] = np.ones(count + 2 * reach), np.arange(count + 2 * reach)
    smooth = np.fft.irfft(np.sum(np.fft.rfft(_by_phase(lines, step), axis=2) * gains, axis=1), low, axis=1)
    of_chord = np.array([np.ones(kept), reach + step * np.arange(kept)]) - smooth[:, lead // step : lead // step + kept]
    return _Phases(reach, lead // step, low, (outside % step, outside // step), gains, of_chord)


def differentiate(signal: Array, rate: float, cut: float | None) -> tuple[Array, Array, Array]:
    """Low-pass a signal and take its first two derivatives in the same step.

    Parameters
    ----------
    signal : ndarray, shape (..., N)
    rate : float
        Samples per second.
    cut : float or None
        Frequency in Hz where half the amplitude is left; None filters nothing.

    Returns
    -------
    tuple of ndarray, each of shape (..., N)
        The filtered signal, its derivative in 1/s and its second derivative in 1/s^2.
    """
    smooth, first, second = _filtered(signal, rate, cut, (0, 1, 2))
    return smooth, first, second


def derivative(signal: Array, rate: float, cut: float | None, order: int) -> Array:
    """Return one of the results of `differentiate`, in less than half the time that all three take.

    Parameters
    ----------
    signal : ndarray, shape (..., N)
    rate, cut : float
        As for `differentiate`.
    order : {0, 1, 2}
        0 is the filtered signal itself.

    Returns
    -------
    ndarray, shape (..., N)
    """
    return np.asarray(_filtered(signal, rate, cut, (order,))[0])


def _filtered(
    signal: Array, rate: float, cut: float | None, orders: Sequence[int], highest: float = np.inf, step: int = 1
) -> Array:
    """Return derivatives of a low-passed signal, with nothing beyond the highest frequency, Hz; shape (orders, ..., N)."""
    count = signal.shape[-1]
    periods = rate / cut if cut is not None else 32.0
    reach = min(count - 1, int(np.ceil(MEMORY_PERIODS * periods)) + 1)
    closed = _closed_length(count, reach, step)
    # The ends are zero without the chord, so zeros continue the signal.
    whole = np.zeros((*signal.shape[:-1], closed))
    flat = whole[..., : count + 2 * reach]
    ramp, slope = _continue(signal, reach, flat)
    if cut is None:
        # No filter would stop the kink where the ends meet from ringing through the derivatives.
        fade = np.sin(0.5 * np.pi * np.arange(reach) / reach) ** 2
        flat[..., :reach] *= fade
        flat[..., -reach:] *= fade[::-1]
    factors = _gains(closed, rate, cut, tuple(orders), highest)
    spectra = factors.reshape(len(orders), *(1,) * (signal.ndim - 1), -1) * np.fft.rfft(whole, axis=-1)
    results = np.fft.irfft(spectra, closed, axis=-1)[..., reach : reach + count]
    for order, result in zip(orders, results, strict=True):
        if order == 0:
            result += ramp[..., reach : reach + count]
        elif order == 1:
            result += slope * rate
    return results


def _continue(signal: Array, reach: int, out: Array) -> tuple[Array, Array]:
    """Continue a signal (..., N) at both ends into ``out`` (..., N + 2 reach), and return its chord, taken away, and the chord's slope.

    Without its chord the continued signal closes on itself; the chord is put back after.
    """
    count = signal.shape[-1]
    np.subtract(2.0 * signal[..., :1], signal[..., reach:0:-1], out=out[..., :reach])
    out[..., reach : reach + count] = signal
    np.subtract(2.0 * signal[..., -1:], signal[..., -2 : -reach - 2 : -1], out=out[..., reach + count :])
    start = out[..., :1].copy()
    slope = (out[..., -1:] - start) / (out.shape[-1] - 1)
    ramp = np.arange(out.shape[-1], dtype=float) * slope
    ramp += start
    out -= ramp
    return ramp, slope


@lru_cache(maxsize=24)
def _gains(
    closed: int, rate: float, cut: float | None, orders: tuple[int, ...], highest: float
) -> NDArray[np.complexfloating]:
    """Return by what the transform of a signal is multiplied for each derivative, shape (orders, closed // 2 + 1)."""
    frequency = np.arange(closed // 2 + 1) * (rate / closed)
    # A power of 8 by squares: `**` takes as long as the transform.
    eighth = frequency if cut is None else frequency / cut
    for _ in range(3):
        eighth = eighth * eighth
    gain = np.ones_like(frequency) if cut is None else 1.0 / (1.0 + eighth)
    gain[frequency > highest] = 0.0
    omega = 2.0 * np.pi * frequency
    return np.array([gain * (1.0, 1j * omega, -omega * omega)[order] for order in orders])


def _closed_length(count: int, reach: int, step: int) -> int:
    """Return how long a signal is, continued at both ends, that is transformed fast and falls on every step-th sample."""
    from scipy.fft import next_fast_len

    lead = -(-reach // step) * step
    return step * int(next_fast_len(-(-(lead + count + reach) // step), real=True))
