"""Interpolation between samples whose times jitter."""

from __future__ import annotations

import numpy as np

from scara_ident.arrays import Array


def cubic_spline(time: Array, signals: Array, at: Array) -> Array:
    """Interpolate signals by a cubic spline whose third derivative is continuous at the second and last but one sample.

    What `scipy.interpolate.CubicSpline` gives ("not a knot"; de Boor 1978, A Practical Guide to Splines, ch. IV), without
    the half second that the import of that package takes.

    Parameters
    ----------
    time : ndarray, shape (N,)
        Increasing, at least four.
    signals : ndarray, shape (k, N)
    at : ndarray, shape (M,)
        Where they are wanted; beyond the ends the outermost cubic continues.

    Returns
    -------
    ndarray, shape (k, M)
    """
    from scipy.linalg import solve_banded

    count = len(time)
    step = np.diff(time)
    slope = np.diff(signals, axis=1) / step
    # Equations of the derivative at each sample: above, on and below the diagonal.
    bands = np.zeros((3, count))
    bands[0, 2:], bands[1, 1:-1], bands[2, :-2] = step[:-1], 2.0 * (step[:-1] + step[1:]), step[1:]
    target = np.empty((count, len(signals)))
    target[1:-1] = 3.0 * (step[1:] * slope[:, :-1] + step[:-1] * slope[:, 1:]).T
    first, last = step[0] + step[1], step[-1] + step[-2]
    bands[1, 0], bands[0, 1] = step[1], first
    target[0] = ((step[0] + 2.0 * first) * step[1] * slope[:, 0] + step[0] ** 2 * slope[:, 1]) / first
    bands[1, -1], bands[2, -2] = step[-2], last
    target[-1] = (step[-1] ** 2 * slope[:, -2] + (2.0 * last + step[-1]) * step[-2] * slope[:, -1]) / last
    derivative = np.asarray(solve_banded((1, 1), bands, target)).T
    piece = np.clip(np.searchsorted(time, at, side="right") - 1, 0, count - 2)
    way, width = at - time[piece], step[piece]
    here, mean = derivative[:, piece], slope[:, piece]
    bend = here + derivative[:, piece + 1] - 2.0 * mean
    square, cube = (mean - here - bend) / width, bend / width**2
    return np.asarray(signals[:, piece] + way * (here + way * (square + way * cube)))
