"""Residuals gathered over a signal: density, means with bands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MEAN_BINS = 24
LEAST_COUNT = 8
DENSITY_BINS = (72, 44)


@dataclass(frozen=True, eq=False)
class Means:
    """Mean of y in bins of x with its standard error; bins with few samples are NaN."""

    x: Array
    y: Array
    error: Array


def middle_range(x: Array, share: float = 0.995) -> tuple[float, float]:
    """Return the limits that leave out the outermost samples, never of no width."""
    low, high = (float(v) for v in np.quantile(x, [1.0 - share, share]))
    return (low, high) if high > low else (low - 0.5, high + 0.5)


def binned_means(x: Array, y: Array, limits: tuple[float, float], bins: int = MEAN_BINS) -> Means:
    """Return means of y over x, samples in the order of time.

    The standard error counts visits to a bin rather than samples: within one visit residuals are alike.

    Parameters
    ----------
    x, y : ndarray, shape (N,)
    limits : tuple of float
    bins : int, optional
    """
    place = np.floor((x - limits[0]) / (limits[1] - limits[0]) * bins).astype(int)
    inside = (place >= 0) & (place < bins)
    enters = inside.copy()
    enters[1:] &= place[1:] != place[:-1]
    count = np.bincount(place[inside], minlength=bins)
    visits = np.bincount(place[enters], minlength=bins)
    total = np.bincount(place[inside], y[inside], minlength=bins)
    square = np.bincount(place[inside], y[inside] ** 2, minlength=bins)
    enough = count >= LEAST_COUNT
    size = np.maximum(count, 1)
    mean = total / size
    variance = np.clip(square / size - mean**2, 0.0, None)
    centres = limits[0] + (np.arange(bins) + 0.5) * (limits[1] - limits[0]) / bins
    return Means(
        centres,
        np.where(enough, mean, np.nan),
        np.where(enough, np.sqrt(variance / np.maximum(visits, 1)), np.nan),
    )


def density(x: Array, y: Array, x_limits: tuple[float, float], y_limits: tuple[float, float]) -> Array:
    """Count samples in a grid of bins, shape ``DENSITY_BINS``."""
    nx, ny = DENSITY_BINS
    i = np.floor((x - x_limits[0]) / (x_limits[1] - x_limits[0]) * nx).astype(int)
    k = np.floor((y - y_limits[0]) / (y_limits[1] - y_limits[0]) * ny).astype(int)
    inside = (i >= 0) & (i < nx) & (k >= 0) & (k < ny)
    return np.bincount(i[inside] * ny + k[inside], minlength=nx * ny).reshape(nx, ny).astype(float)
