"""The type of all arrays of real numbers, whose shapes docstrings give, and their median."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def median(values: Array) -> float:
    """Return the median of at least one number, shape (N,), NaN if one of them is.

    As `np.median`, which takes five times as long: NumPy finds two places of an order much slower than one.
    """
    middle = len(values) // 2
    parts = np.partition(values, middle)
    if np.isnan(np.max(parts[middle:])):
        return np.nan
    return float(parts[middle] if len(values) % 2 else 0.5 * (np.max(parts[:middle]) + parts[middle]))
