"""Arrays of numbers as columns: of a matrix ``q`` every channel is a column ``q[0]``, ``q[1]``, ..."""

from __future__ import annotations

from typing import Any

import numpy as np

from scara_ident.arrays import Array

# A matrix with more channels than this is a picture or a table of something else, not a log of joints.
MOST_CHANNELS = 128


def channels(name: str, shape: tuple[int, ...]) -> list[str]:
    """Name the columns of an array; none for a scalar, or where it is no log.

    Axes of length one do not count. Of a matrix the longer axis is time, so that it does not matter whether samples
    stand in rows or in columns.
    """
    sizes = [size for size in shape if size != 1]
    if len(sizes) == 1 and sizes[0] > 1:
        return [name]
    if len(sizes) == 2 and 1 < min(sizes) <= MOST_CHANNELS:
        return [f"{name}[{k}]" for k in range(min(sizes))]
    return []


def column(array: Any, name: str, wanted: str) -> Array:
    """Take the column ``wanted`` of the array called ``name``, as float64."""
    values = np.squeeze(np.asarray(array))
    if wanted == name:
        return np.ascontiguousarray(values, dtype=np.float64)
    index = int(wanted.removeprefix(name).strip("[]"))
    samples_first = values.shape[0] >= values.shape[1]
    return np.ascontiguousarray(values[:, index] if samples_first else values[index], dtype=np.float64)


def is_number(dtype: np.dtype[Any]) -> bool:
    """Tell whether an array holds real numbers or truth values."""
    return dtype.kind in "fiub"
