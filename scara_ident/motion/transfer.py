"""A uniform signal through a linear filter that is given by its frequency response."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array


def through(
    signal: Array, response: Callable[[Array], NDArray[np.complexfloating]], memory: int
) -> tuple[Array, Array, Array]:
    """Filter a signal minus its chord, extended by odd reflection at its ends, in the frequency domain.

    Parameters
    ----------
    signal : ndarray, shape (..., N)
    response : callable
        Gain at angular frequencies in rad per sample, complex.
    memory : int
        Samples over which the filter's impulse response extends, to either side.

    Returns
    -------
    filtered : ndarray, shape (..., N)
    chord, slope : ndarray, shapes (..., N) and (..., 1)
        The line through the ends of the extended signal, which was subtracted, and its rise per sample. A filter with
        the static gain g and the mean delay T turns it into ``g (chord - T slope)``.
    """
    # Most runs need no such filter, and SciPy's transforms take a while to load.
    from scipy.fft import next_fast_len

    count = signal.shape[-1]
    reach = min(count - 1, memory)
    head = 2.0 * signal[..., :1] - signal[..., reach:0:-1]
    tail = 2.0 * signal[..., -1:] - signal[..., -2 : -reach - 2 : -1]
    extended = np.concatenate([head, signal, tail], axis=-1)
    length = extended.shape[-1]
    # Without its chord the extended signal begins and ends at zero, and zeros continue it to a length that is transformed fast.
    slope = (extended[..., -1:] - extended[..., :1]) / (length - 1)
    ramp = extended[..., :1] + slope * np.arange(length)
    closed = int(next_fast_len(length, real=True))
    gain = np.array(response(np.asarray(2.0 * np.pi * np.fft.rfftfreq(closed), dtype=float)), dtype=complex)
    if closed % 2 == 0:
        gain[-1] = gain[-1].real
    moved = np.fft.irfft(np.fft.rfft(extended - ramp, closed, axis=-1) * gain, closed, axis=-1)
    inside = slice(reach, reach + count)
    return np.asarray(moved[..., inside]), ramp[..., inside], slope
