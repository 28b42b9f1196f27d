"""Zero-phase low-pass and derivatives.

One filter serves all: the squared magnitude of a fourth-order Butterworth low-pass, 1 / (1 + (f/fc)^8), applied
in the frequency domain to the signal continued by odd reflection. It has no phase, and derivatives are taken in
the same step, exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array

# Cut-off over sample rate above which a low-pass is left out: it would take off next to nothing.
HIGHEST_CUT = 0.45
# The filter's memory in periods of its cut-off: 4 of them leave under 1e-4 of a step.
MEMORY_PERIODS = 4.0
# A low-passed signal has nothing beyond this many times its cut-off, where the filter would leave 6e-8.
HIGHEST = 8.0
# Signals that are transformed together: more of them leave the cache of a core.
ROWS_AT_ONCE = 4


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
    return np.asarray(_filtered(signal, rate, cut, (0,), HIGHEST * cut, step)[0])


def low_pass_every(signal: Array, rate: float, cut: float | None, step: int, weight: Array | None = None) -> Array:
    """Return every ``step``-th sample of `low_pass`, from the first on, without computing the others.

    The spectrum is folded at the lower rate, which is what leaving out samples does to it, so that the result is the
    same to rounding if `low_pass` is told the step.

    Parameters
    ----------
    signal : ndarray, shape (k, N)
    rate : float
        Samples per second.
    cut : float or None
        Frequency in Hz where half the amplitude is left; None filters nothing.
    step : int
    weight : ndarray, shape (N,) or (k, N), optional
        The signal is multiplied by it first.

    Returns
    -------
    ndarray, shape (k, ceil(N / step))
    """
    if cut is None or step == 1:
        return low_pass(signal if weight is None else weight * signal, rate, cut)[..., ::step]
    count = signal.shape[-1]
    folding = _folding(count, rate / cut, step)
    reach, lead = folding.reach, folding.lead
    kept, low = folding.of_chord.shape[1], folding.closed // step
    result = np.empty((len(signal), kept))
    buffer = np.empty((min(ROWS_AT_ONCE, len(signal)), folding.closed))
    buffer[:, : lead - reach] = buffer[:, lead + count + reach :] = 0.0
    whole = np.empty((len(buffer), folding.closed // 2 + 1), dtype=complex)
    for begin in range(0, len(signal), ROWS_AT_ONCE):
        rows = signal[begin : begin + ROWS_AT_ONCE]
        flat = buffer[: len(rows)]
        middle = flat[:, lead : lead + count]
        if weight is None:
            middle[:] = rows
        else:
            np.multiply(rows, weight if weight.ndim == 1 else weight[begin : begin + len(rows)], out=middle)
        first, last = middle[:, :1], middle[:, -1:]
        np.subtract(2.0 * first, middle[:, reach:0:-1], out=flat[:, lead - reach : lead])
        np.subtract(2.0 * last, middle[:, -2 : -reach - 2 : -1], out=flat[:, lead + count : lead + count + reach])
        np.fft.rfft(flat, axis=1, out=whole[: len(rows)])
        smooth = np.fft.irfft(folding.folded(whole[: len(rows)]), low, axis=1)[:, lead // step : lead // step + kept]
        # Without its chord the continued signal closes on itself; what the filter does to the chord is known.
        start, stop = flat[:, lead - reach, None], flat[:, lead + count + reach - 1, None]
        chord = np.column_stack([start, (stop - start) / (count - 1 + 2 * reach)])
        np.add(smooth, chord @ folding.of_chord, out=result[begin : begin + len(rows)])
    return result


@dataclass(frozen=True, eq=False)
class _Folding:
    """How the spectrum of a continued signal is filtered and folded at a lower rate.

    Attributes
    ----------
    reach, lead, closed : int
        Samples that continue the signal, from the start to its first sample, and in all.
    step : int
        Samples per kept sample.
    gain : ndarray
        Of the filter, up to where it leaves nothing.
    of_chord : ndarray, shape (2, kept)
        What is missing of a constant 1 and of the number of the sample, each over the continued signal and zero beyond.
    """

    reach: int
    lead: int
    closed: int
    step: int
    gain: Array
    of_chord: Array

    def folded(self, spectrum: NDArray[np.complexfloating]) -> NDArray[np.complexfloating]:
        """Return the spectrum of the filtered signal at the lower rate; that given is overwritten."""
        low = self.closed // self.step
        half = low // 2 + 1
        passed = spectrum[:, : len(self.gain)]
        passed *= self.gain
        folded = np.zeros((len(spectrum), half), dtype=complex)
        for first in range(0, len(self.gain), low):
            part = passed[:, first : first + half]
            folded[:, : part.shape[1]] += part
            # Frequencies just below a multiple of the lower rate mirror those just below zero.
            mirrored = passed[:, first + low - half + 1 : first + low + 1][:, ::-1]
            folded[:, half - mirrored.shape[1] :] += np.conj(mirrored)
        return folded


@lru_cache(maxsize=256)
def _folding(count: int, ratio: float, step: int) -> _Folding:
    """Return how signals of so many samples are low-passed at the sample rate over a ratio, and folded."""
    reach = min(count - 1, int(np.ceil(MEMORY_PERIODS * ratio)) + 1)
    # The first sample must fall on the lower grid.
    lead = -(-reach // step) * step
    closed = _closed_length(count, reach, step)
    frequency = np.arange(min(closed // 2, int(HIGHEST * closed / ratio)) + 1) * (ratio / closed)
    gain = np.asarray(1.0 / (step * (1.0 + frequency**8)), dtype=float)
    # Half the rate is its own mirror image.
    gain[2 * np.arange(len(frequency)) == closed] *= 0.5
    kept = -(-count // step)
    folding = _Folding(reach, lead, closed, step, gain, np.zeros((2, kept)))
    lines = np.zeros((2, closed))
    lines[:, lead - reach : lead + count + reach] = np.ones(count + 2 * reach), np.arange(count + 2 * reach)
    smooth = np.fft.irfft(folding.folded(np.fft.rfft(lines, axis=1)), closed // step, axis=1)
    kept_lines = np.array([np.ones(kept), reach + step * np.arange(kept)])
    return replace(folding, of_chord=kept_lines - smooth[:, lead // step : lead // step + kept])


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


def _filtered(
    signal: Array, rate: float, cut: float | None, orders: Sequence[int], highest: float = np.inf, step: int = 1
) -> Array:
    """Return derivatives of a low-passed signal, with nothing beyond the highest frequency, Hz; shape (orders, ..., N)."""
    count = signal.shape[-1]
    periods = rate / cut if cut is not None else 32.0
    reach = min(count - 1, int(np.ceil(MEMORY_PERIODS * periods)) + 1)
    length, closed = count + 2 * reach, _closed_length(count, reach, step)
    # The ends are zero without the chord, so zeros continue the signal.
    whole = np.zeros((*signal.shape[:-1], closed))
    flat = whole[..., :length]
    np.subtract(2.0 * signal[..., :1], signal[..., reach:0:-1], out=flat[..., :reach])
    flat[..., reach : reach + count] = signal
    np.subtract(2.0 * signal[..., -1:], signal[..., -2 : -reach - 2 : -1], out=flat[..., reach + count :])
    # Without its chord the continued signal closes on itself; the chord is put back after.
    start = flat[..., :1].copy()
    slope = (flat[..., -1:] - start) / (length - 1)
    ramp = np.arange(length, dtype=float) * slope
    ramp += start
    flat -= ramp
    if cut is None:
        # No filter would stop the kink where the ends meet from ringing through the derivatives.
        fade = np.sin(0.5 * np.pi * np.arange(reach) / reach) ** 2
        flat[..., :reach] *= fade
        flat[..., -reach:] *= fade[::-1]
    spectrum = np.fft.rfft(whole, axis=-1)
    frequency = np.arange(closed // 2 + 1) * (rate / closed)
    # A power of 8 by squares: `**` takes as long as the transform.
    eighth = frequency if cut is None else frequency / cut
    for _ in range(3):
        eighth = eighth * eighth
    gain = np.ones_like(frequency) if cut is None else 1.0 / (1.0 + eighth)
    gain[frequency > highest] = 0.0
    omega = 2.0 * np.pi * frequency
    factors = np.array([gain * (1.0, 1j * omega, -omega * omega)[order] for order in orders])
    spectra = factors.reshape(len(orders), *(1,) * (signal.ndim - 1), -1) * spectrum
    results = np.fft.irfft(spectra, closed, axis=-1)[..., reach : reach + count]
    for order, result in zip(orders, results, strict=True):
        if order == 0:
            result += ramp[..., reach : reach + count]
        elif order == 1:
            result += slope * rate
    return results


def _closed_length(count: int, reach: int, step: int) -> int:
    """Return how long a signal is, continued at both ends, that is transformed fast and falls on every step-th sample."""
    lead = -(-reach // step) * step
    return step * _fast_length(-(-(lead + count + reach) // step))


@lru_cache(maxsize=1024)
def _fast_length(length: int) -> int:
    """Return the next length whose only prime factors are 2, 3 and 5."""
    best = 1 << (length - 1).bit_length()
    five = 1
    while five < best:
        three = five
        while three < best:
            two = three
            while two < length:
                two *= 2
            best = min(best, two)
            three *= 3
        five *= 5
    return best
