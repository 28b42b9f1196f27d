"""MATLAB files: version 5 to 7.2 by SciPy, version 7.3 as the HDF5 that it is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError
from scara_ident.memory import check_memory, within_limit
from scara_ident.recording.files import arrays, hdf5
from scara_ident.recording.files.files import check_file, damaged

HDF5_VERSION = b"MATLAB 7.3"
# A number of the largest kind.
BYTES = 8


def column_names(path: Path) -> tuple[str, ...]:
    """List the columns: arrays by their name, fields of structs after dots, channels of matrices as ``q[0]``.

    Raises
    ------
    RecordingError
        The file is missing, empty, damaged or without numbers.
    """
    if _is_hdf5(path):
        return hdf5.column_names(path, separator=".")
    return arrays.names_of(
        path, _arrays(path), "save arrays or structs of arrays (timeseries and tables cannot be read)"
    )


def read_columns(path: Path, names: Sequence[str]) -> dict[str, Array]:
    """Read some columns as float64.

    Raises
    ------
    RecordingError
        The file is damaged or lacks a column.
    """
    if _is_hdf5(path):
        return hdf5.read_columns(path, names, separator=".")
    return arrays.columns_of(path, _arrays(path), names)


def _is_hdf5(path: Path) -> bool:
    check_file(path)
    with path.open("rb") as file:
        return file.read(len(HDF5_VERSION)) == HDF5_VERSION


def _arrays(path: Path) -> Iterator[tuple[str, NDArray[Any]]]:
    from scipy.io import loadmat, whosmat

    try:
        with within_limit(path):
            # SciPy reads past an object of MATLAB, as a table or a timeseries, but cannot list a file that holds one.
            with suppress(TypeError):
                check_memory(path, sum(BYTES * prod(shape) for _, shape, _ in whosmat(path)))
            content = loadmat(path, simplify_cells=True)
    except RecordingError:
        raise
    except Exception as error:
        # SciPy's parser fails in whatever way the damage makes it fail.
        raise damaged(path, "mat", error) from error
    if not content:
        raise RecordingError(f"{path}: no variable in it; save it again")
    for name, value in content.items():
        if not name.startswith("__"):
            yield from _numbers(name, value)


def _numbers(name: str, value: Any) -> Iterator[tuple[str, NDArray[Any]]]:
    if isinstance(value, dict):
        for key, item in value.items():
            yield from _numbers(f"{name}.{key}", item)
    elif isinstance(value, list) or (isinstance(value, np.ndarray) and value.dtype == object and value.ndim == 1):
        for index, item in enumerate(value):
            yield from _numbers(f"{name}[{index}]", item)
    elif isinstance(value, np.ndarray) and arrays.is_number(value.dtype):
        yield name, value
