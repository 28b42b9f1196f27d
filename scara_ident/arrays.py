"""The type of all arrays of real numbers, whose shapes docstrings give, their median, and where flags are set."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# Median of a normal variable's size.
NORMAL_MEDIAN = 0.6745


def median(values: Array) -> float:
    """Return the median of at least one number, shape (N,), NaN if one of them is."""
    return float(medians(values))


def medians(values: Array) -> Array:
    """Return the median of each row, (..., N) with at least one number each, NaN where one of them is; shape (...).

    As `np.median`, which takes five times as long: NumPy finds two places of an order much slower than one.
    """
    middle, odd = divmod(values.shape[-1], 2)
    parts = np.partition(values, middle)
    # A number that is none is above all others.
    none = np.isnan(parts[..., middle:].max(axis=-1))
    upper = parts[..., middle]
    return np.where(none, np.nan, upper if odd else 0.5 * (parts[..., :middle].max(axis=-1) + upper))


def runs_of(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Return where flags, (M,), are set one after the other: the first place, and the one after the last."""
    between = np.zeros(len(flags) + 2, dtype=bool)
    between[1:-1] = flags
    edges = np.flatnonzero(between[1:] != between[:-1])
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))
