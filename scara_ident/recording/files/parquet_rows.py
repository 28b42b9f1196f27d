"""Some rows of a Parquet file, without the others: which groups of rows it has, and reading from one row to another.

A reader unpacks whole groups of rows, so that the largest says how much memory reading any row takes. The groups stand in the
footer, in Thrift's compact protocol (Apache Parquet format, `parquet.thrift`; Thrift, "Compact protocol").
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from scara_ident.arrays import Array
from scara_ident.quiet import quiet_stderr
from scara_ident.recording.files.parquet_csv import damaged_table, numbers

_MAGIC = b"PAR1"
# Fields of the footer and of a group of rows.
_GROUPS, _ROWS = 4, 3
# Types of Thrift's compact protocol.
_TRUE, _FALSE, _BYTE, _DOUBLE, _BINARY, _LIST, _SET, _STRUCT = 1, 2, 3, 7, 8, 9, 10, 12


def row_groups(path: Path) -> tuple[int, ...]:
    """Return how many rows each group of rows of a Parquet file has.

    Raises
    ------
    RecordingError
        If the file is not whole.
    """
    try:
        with path.open("rb") as file:
            size = file.seek(0, 2)
            file.seek(max(0, size - 8))
            end = file.read()
            length = int.from_bytes(end[:4], "little")
            if end[4:] != _MAGIC or length + 12 > size:
                raise ValueError("its end is missing")
            file.seek(size - 8 - length)
            footer, _ = _struct(file.read(length), 0)
        return tuple(int(group[_ROWS]) for group in footer[_GROUPS])
    except (OSError, ValueError, KeyError, IndexError, TypeError, RecursionError) as error:
        raise damaged_table(path, error) from error


def seekable(path: Path, time: str, names: Sequence[str]) -> bool:
    """Tell whether rows of these columns read alone are what they are in the whole: numbers, and a clock that starts nowhere.

    Raises
    ------
    RecordingError
        A damaged file.
    """
    import polars as pl

    with path.open("rb") as file:
        schema = pl.read_parquet_schema(file)
    clock = schema.get(time)
    points = isinstance(clock, pl.Datetime) and bool(len(_first(path, time).drop_nulls()))
    return all(name in schema and schema[name].is_numeric() for name in names if name != time or not points)


def read_rows(path: Path, names: Sequence[str], start: int, stop: int) -> dict[str, Array]:
    """Read rows of some columns as float64, those from ``start`` to before ``stop``, counted from 0.

    Parameters
    ----------
    path : Path
        For which `seekable` holds.

    Returns
    -------
    dict of str to ndarray, shape (stop - start,)
        NaN where the file has no value; points in time in s since the first of the file.

    Raises
    ------
    RecordingError
        A damaged file.
    """
    import polars as pl

    frame = _frame(path, names, start, stop)
    found = {}
    for name in names:
        if frame[name].dtype.is_numeric():
            found[name] = numbers(path, frame[name])
        else:
            found[name] = numbers(path, pl.concat([_first(path, name), frame[name]]))[1:]
    return found


def _first(path: Path, name: str) -> Any:
    """Return the first row of a column."""
    return _frame(path, [name], 0, 1)[name]


def _frame(path: Path, names: Sequence[str], start: int, stop: int) -> Any:
    import polars as pl

    try:
        rows = pl.scan_parquet(path, glob=False, hive_partitioning=False).select(names).slice(start, stop - start)
        with quiet_stderr():
            return rows.collect()
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError) as error:
        raise damaged_table(path, error) from error


def _struct(data: bytes, place: int) -> tuple[dict[int, Any], int]:
    """Return the fields of a structure by their numbers, and where it ends."""
    found: dict[int, Any] = {}
    field = 0
    while True:
        head = data[place]
        place += 1
        if head == 0:
            return found, place
        kind = head & 15
        if head >> 4:
            field += head >> 4
        else:
            field, place = _integer(data, place)
        if kind in (_TRUE, _FALSE):
            found[field] = kind == _TRUE
        else:
            found[field], place = _value(data, place, kind)


def _value(data: bytes, place: int, kind: int) -> tuple[Any, int]:
    if kind == _STRUCT:
        return _struct(data, place)
    if kind in (_TRUE, _FALSE, _BYTE):
        return data[place], place + 1
    if kind == _DOUBLE:
        return None, place + 8
    if kind == _BINARY:
        length, place = _natural(data, place)
        return None, place + length
    if kind in (_LIST, _SET):
        head = data[place]
        count, place = (head >> 4, place + 1) if head >> 4 < 15 else _natural(data, place + 1)
        items = []
        for _ in range(count):
            item, place = _value(data, place, head & 15)
            items.append(item)
        return items, place
    if kind < _DOUBLE:
        return _integer(data, place)
    raise ValueError(f"type {kind} in its footer")


def _integer(data: bytes, place: int) -> tuple[int, int]:
    value, place = _natural(data, place)
    return (value >> 1) ^ -(value & 1), place


def _natural(data: bytes, place: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = data[place]
        place += 1
        value |= (byte & 127) << shift
        if byte < 128:
            return value, place
        shift += 7
