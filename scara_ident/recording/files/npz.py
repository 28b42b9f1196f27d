"""NumPy's archives of arrays, ``.npz``: what Python scripts beside an arm save."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError
from scara_ident.memory import check_memory, within_limit
from scara_ident.recording.files import arrays
from scara_ident.recording.files.files import check_file, damaged


def column_names(path: Path) -> tuple[str, ...]:
    """List the columns: arrays by their name, channels of matrices as ``q[0]``.

    Raises
    ------
    RecordingError
        The file is missing, empty, damaged or without numbers.
    """
    return arrays.names_of(path, _arrays(path), "save arrays of numbers, by np.savez")


def read_columns(path: Path, names: Sequence[str]) -> dict[str, Array]:
    """Read some columns as float64.

    Raises
    ------
    RecordingError
        The file is damaged or lacks a column.
    """
    return arrays.columns_of(path, _arrays(path), names)


def _arrays(path: Path) -> Iterator[tuple[str, NDArray[Any]]]:
    check_file(path)
    found = list[tuple[str, NDArray[Any]]]()
    try:
        with within_limit(path), zipfile.ZipFile(path) as archive:
            check_memory(path, sum(item.file_size for item in archive.infolist()))
            for item in archive.infolist():
                with archive.open(item) as file:
                    array = _array(file)
                if array is not None and arrays.is_number(array.dtype):
                    found.append((item.filename.removesuffix(".npy"), array))
    except RecordingError:
        raise
    except Exception as error:
        # NumPy's parser fails in whatever way the damage makes it fail.
        raise damaged(path, "npz", error) from error
    yield from found


def _array(file: Any) -> NDArray[Any] | None:
    """Read an array; None where it holds Python's objects, which only running what the file says would give."""
    version = np.lib.format.read_magic(file)
    header = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
    if header(file)[2].hasobject:
        return None
    file.seek(0)
    return np.asarray(np.lib.format.read_array(file, allow_pickle=False))
