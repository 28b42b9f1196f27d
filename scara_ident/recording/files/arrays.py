"""Arrays of numbers as columns: of a matrix ``q`` every channel is a column ``q[0]``, ``q[1]``, ..."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.recording.files.files import chosen, refuse_no_numbers

# A matrix with more channels than this is a picture or a table of something else, not a log of joints.
MAX_CHANNELS = 128


def names_of(path: Path, content: Iterable[tuple[str, NDArray[Any]]], wanted: str) -> tuple[str, ...]:
    """Name the columns of all arrays of a file.

    Raises
    ------
    RecordingError
        It has none; ``wanted`` says what to save instead.
    """
    names = [name for key, array in content for name in channels(key, array.shape)]
    if not names:
        refuse_no_numbers(path, wanted)
    return tuple(names)


def columns_of(path: Path, content: Iterable[tuple[str, NDArray[Any]]], names: Sequence[str]) -> dict[str, Array]:
    """Take some columns of the arrays of a file, as float64.

    Raises
    ------
    RecordingError
        It lacks one.
    """
    found = {
        name: column(array, key, name) for key, array in content for name in channels(key, array.shape) if name in names
    }
    return chosen(path, found, names)


def channels(name: str, shape: tuple[int, ...]) -> list[str]:
    """Name the columns of an array; none for a scalar, or where it is no log.

    Axes of length one do not count. Of a matrix the longer axis is time, so that it does not matter whether samples
    stand in rows or in columns.
    """
    sizes = [size for size in shape if size != 1]
    if len(sizes) == 1 and sizes[0] > 1:
        return [name]
    if len(sizes) == 2 and 1 < min(sizes) <= MAX_CHANNELS:
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
