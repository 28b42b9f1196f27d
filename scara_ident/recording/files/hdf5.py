"""HDF5 files: every data set of numbers, by its path."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from math import prod
from pathlib import Path
from typing import Any

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError
from scara_ident.memory import check_memory, within_limit
from scara_ident.recording.files import arrays
from scara_ident.recording.files.files import check_file, chosen, damaged, optional_module, refuse_no_numbers

# MATLAB keeps what cells and objects point to in groups of this kind of name.
HIDDEN = "#"
# A number as it is stored, and as float64.
BYTES = 16


def column_names(path: Path, *, separator: str = "/") -> tuple[str, ...]:
    """List the columns: data sets by their path, fields of tables after a dot, channels of matrices as ``q[0]``.

    Parameters
    ----------
    separator : str
        What stands between a group and its members.

    Raises
    ------
    RecordingError
        h5py is not installed, or the file is missing, empty, damaged or without numbers.
    """
    with _opened(path) as file:
        names = [name for key, _, _, shape in _sets(path, file, separator) for name in arrays.channels(key, shape)]
    if not names:
        refuse_no_numbers(path, "save data sets of numbers")
    return tuple(names)


def read_columns(path: Path, names: Sequence[str], *, separator: str = "/") -> dict[str, Array]:
    """Read some columns as float64.

    Raises
    ------
    RecordingError
        The file is damaged or lacks a column.
    """
    found: dict[str, Array] = {}
    total = 0
    with _opened(path) as file:
        for key, data, field, shape in _sets(path, file, separator):
            wanted = [name for name in arrays.channels(key, shape) if name in names]
            if wanted:
                # Whatever the file holds of it: what was never written is read as zeros.
                total += prod(shape) * BYTES
                check_memory(path, total)
                values = data[()] if field is None else data[field]
                found |= {name: arrays.column(values, key, name) for name in wanted}
    return chosen(path, found, names)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    check_file(path)
    h5py = optional_module("h5py", "hdf5", path)
    try:
        with within_limit(path), h5py.File(path, "r") as file:
            yield file
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        if isinstance(error, RecordingError):
            raise
        raise damaged(path, path.suffix.lower().lstrip("."), error) from error


def _sets(path: Path, file: Any, separator: str) -> Iterator[tuple[str, Any, str | None, tuple[int, ...]]]:
    """Yield the name, data set, field and shape of all that holds numbers."""
    for place, data in _walk(path, file, "", set()):
        name = place.strip("/").replace("/", separator)
        if data.dtype.names:
            for field in data.dtype.names:
                kind = data.dtype[field]
                if arrays.is_number(kind.base):
                    yield f"{name}.{field}", data, field, (*data.shape, *kind.shape)
        elif arrays.is_number(data.dtype) and data.attrs.get("MATLAB_class", b"") != b"char":
            yield name, data, None, data.shape


def _walk(path: Path, group: Any, above: str, seen: set[Any]) -> Iterator[tuple[str, Any]]:
    """Yield name and data set of all in a group, groups that hold each other once.

    Raises
    ------
    RecordingError
        Numbers that lie in another file, of which nobody can say what it is, or a name that is no text.
    """
    seen.add(group.id)
    for key in group:
        if not isinstance(key, str):
            raise RecordingError(f"{path}: the name {key!r} in it is not text in UTF-8; rename it")
        name = f"{above}/{key}"
        if hasattr(group.get(key, getlink=True), "filename"):
            raise _outside(path, name)
        # A link may lead nowhere.
        item = group.get(key)
        if key.startswith(HIDDEN) or item is None:
            continue
        if hasattr(item, "keys"):
            if item.id not in seen:
                yield from _walk(path, item, name, seen)
        elif getattr(item, "shape", None) is not None:
            if item.external or item.is_virtual:
                raise _outside(path, name)
            yield name, item


def _outside(path: Path, name: str) -> RecordingError:
    return RecordingError(
        f"{path}: {name.strip('/')!r} leads to numbers in another file; save a recording that holds its own"
    )
