"""Residuals gathered over a signal: density, means with bands."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array

MEAN_BINS = 24
MIN_COUNT = 8
MIN_VISITS = 5
# Samples, which the band leaves independent, after which residuals are no longer alike.
LONGEST_VISIT = 25
DENSITY_BINS = (72, 44)
# Bins that are narrower in number towards the tails, fewer where many samples are equal, and the logit of the share of
# samples outside the outermost edges.
TAIL_BINS, TAIL = 30, 5.5


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

    The standard error is that of means over visits to a bin, since within one visit residuals are alike; a long visit
    counts as several of ``LONGEST_VISIT`` samples.

    Parameters
    ----------
    x, y : ndarray, shape (N,)
    """
    place = np.floor((x - limits[0]) / (limits[1] - limits[0]) * bins).astype(int)
    centres = limits[0] + (np.arange(bins) + 0.5) * (limits[1] - limits[0]) / bins
    return _means(place, y, centres)


def tail_means(x: Array, y: Array) -> Means:
    """Return means of y over all of x in bins of unequal width, which hold fewer samples the farther out they are.

    What is large in few samples only is then seen, and not alone in bins too empty for a mean.

    Parameters
    ----------
    x, y : ndarray, shape (N,)
        In the order of time.
    """
    shares = 1.0 / (1.0 + np.exp(-np.linspace(-TAIL, TAIL, TAIL_BINS - 1)))
    edges = np.unique(np.quantile(x, shares))
    place = np.searchsorted(edges, x)
    count = np.bincount(place, minlength=len(edges) + 1)
    centres = np.bincount(place, x, minlength=len(edges) + 1) / np.maximum(count, 1)
    return _means(place, y, centres)


def _means(place: NDArray[np.intp], y: Array, centres: Array) -> Means:
    """Means of y by bin, samples in the order of time; those with a place beyond the bins are left out."""
    bins = len(centres)
    inside = (place >= 0) & (place < bins)
    enters = inside.copy()
    enters[1:] &= place[1:] != place[:-1]
    begins = np.flatnonzero(enters)
    since = np.arange(len(y)) - np.concatenate([[0], begins])[np.cumsum(enters)]
    enters |= inside & (since % LONGEST_VISIT == 0)
    count = np.bincount(place[inside], minlength=bins)
    visits = np.bincount(place[enters], minlength=bins)
    total = np.bincount(place[inside], y[inside], minlength=bins)
    enough = count >= MIN_COUNT
    size = np.maximum(count, 1)
    mean = total / size
    visit = (np.cumsum(enters) - 1)[inside]
    departures = np.bincount(visit, y[inside] - mean[place[inside]], minlength=int(np.sum(enters)))
    scatter = np.bincount(place[enters], departures**2, minlength=bins) * visits / np.maximum(visits - 1, 1)
    spread = np.bincount(place[inside], (y[inside] - mean[place[inside]]) ** 2, minlength=bins) / size
    # Few visits do not show their own scatter: then that of the samples stands for it.
    variance = np.where(visits >= MIN_VISITS, scatter / size**2, spread / np.maximum(visits, 1))
    return Means(centres, np.where(enough, mean, np.nan), np.where(enough, np.sqrt(variance), np.nan))


def density(x: Array, y: Array, x_limits: tuple[float, float], y_limits: tuple[float, float]) -> Array:
    """Count samples in a grid of bins, shape ``DENSITY_BINS``."""
    nx, ny = DENSITY_BINS
    i = np.floor((x - x_limits[0]) / (x_limits[1] - x_limits[0]) * nx).astype(int)
    k = np.floor((y - y_limits[0]) / (y_limits[1] - y_limits[0]) * ny).astype(int)
    inside = (i >= 0) & (i < nx) & (k >= 0) & (k < ny)
    return np.bincount(i[inside] * ny + k[inside], minlength=nx * ny).reshape(nx, ny).astype(float)
