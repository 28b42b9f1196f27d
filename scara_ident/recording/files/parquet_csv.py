"""Columns of numbers out of a Parquet or CSV file, and back, with every fault said in one line."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from contextlib import suppress
from io import BytesIO, TextIOWrapper
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError
from scara_ident.files import replacing, why_unwritten
from scara_ident.memory import check_memory
from scara_ident.quiet import quiet_stderr
from scara_ident.recording.files.csv_layout import MISSING, CsvLayout, csv_layout, one_blank
from scara_ident.recording.files.dates import first_wrong, seconds
from scara_ident.recording.files.files import check_file
from scara_ident.recording.files.list_columns import listed_in, names_with_parts, part_of_list

if TYPE_CHECKING:
    import polars as pl

SUFFIXES = (".parquet", ".csv")
# Of a word that is no number, this much is shown.
LONGEST_WORD = 60
# Bytes of a number on its way into an array; of a word, where it is read as such.
PER_VALUE = 24
# A number takes two characters at least, and eight bytes; the file itself is in memory beside it.
CSV_FACTOR = 5


def column_names(path: Path) -> tuple[str, ...]:
    """List the columns of a file without reading its rows.

    Parameters
    ----------
    path : Path
        A ``.parquet`` or ``.csv`` file.

    Returns
    -------
    tuple of str
        Names as they stand in the file, without surrounding blanks; ``column_1``, ``column_2``, ... of a CSV file whose
        first line is data.

    Raises
    ------
    RecordingError
        The file is missing, may not be read, is empty, is of another kind, is damaged, or names a column twice.
    """
    import polars as pl

    check_suffix(path)
    check_file(path)
    try:
        if path.suffix.lower() == ".csv":
            names = list(csv_layout(path).names)
        else:
            with quiet_stderr():
                names = names_with_parts(path, _schema(path))
    except UnicodeDecodeError as error:
        said = "not a text file in UTF-8, UTF-16 or Windows-1252; save the CSV again in UTF-8"
        raise RecordingError(f"{path}: {said}") from error
    except csv.Error as error:
        raise RecordingError(f"{path}: its first line is no header ({error}); put the column names there") from error
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError) as error:
        raise damaged_table(path, error) from error
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise RecordingError(f"{path}: column {twice[0]!r} is in the header twice; rename one of them")
    return tuple(names)


def read_columns(path: Path, names: Sequence[str]) -> dict[str, Array]:
    """Read some columns of a file as float64, and only those.

    Parameters
    ----------
    path : Path
        A file whose ``column_names`` contain all `names`.
    names : sequence of str
        Columns to read.

    Returns
    -------
    dict of str to ndarray, shape (N,)
        NaN where the file has no value; dates and times of day in s since the first.

    Raises
    ------
    RecordingError
        A text where a number belongs (column, row, value), or a damaged file.
    """
    import polars as pl

    try:
        if path.suffix.lower() == ".csv":
            frame = _read_csv(path, names)
        else:
            schema = _schema(path)
            parts = listed_in(schema, names)
            _check_parquet(path, schema, names)
            columns = list(dict.fromkeys(parts[name][0] if name in parts else name for name in names))
            # What is damaged may make it panic, and say so on its own.
            with quiet_stderr():
                frame = pl.read_parquet(path, columns=columns, glob=False, hive_partitioning=False)
            frame = frame.with_columns(part_of_list(schema[name], name, place) for name, place in parts.values())
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, OSError, UnicodeDecodeError) as error:
        raise damaged_table(path, error) from error
    return {name: numbers(path, frame[name]) for name in names}


def write_columns(path: Path, columns: Mapping[str, Array]) -> None:
    """Write columns to a file, whole or not at all.

    Parameters
    ----------
    path : Path
        File to write; Parquet or CSV by its suffix. An existing file is replaced.
    columns : mapping of str to ndarray, shape (N,)
        Columns in the order in which they are to stand.

    Raises
    ------
    RecordingError
        Another suffix, or a folder that is missing, full or not to be written to.
    """
    import polars as pl

    check_suffix(path)
    frame = pl.DataFrame(dict(columns))
    try:
        with replacing(path) as temporary, temporary.open("wb") as file:
            if path.suffix.lower() == ".csv":
                frame.write_csv(file)
            else:
                frame.write_parquet(file)
    except (OSError, pl.exceptions.PolarsError) as error:
        # The Parquet writer wraps what the disk says.
        raise RecordingError(f"{path}: cannot be written: {why_unwritten(error)}") from error


def check_suffix(path: Path) -> None:
    """Refuse a file that is neither Parquet nor CSV by its suffix."""
    if path.suffix.lower() not in SUFFIXES:
        raise RecordingError(f"{path}: suffix {path.suffix!r} is not known; a recording is a .parquet or .csv file")


def _read_csv(path: Path, names: Sequence[str]) -> pl.DataFrame:
    import polars as pl

    check_memory(path, CSV_FACTOR * path.stat().st_size)
    layout = csv_layout(path)
    # By place: names may be those of units too, and the reader's own differ by its version.
    place = {name: layout.names.index(name) for name in names}
    how: dict[str, Any] = {
        "has_header": False,
        "columns": sorted(place.values()),
        "skip_lines": layout.first,
        "separator": layout.separator,
        "null_values": list(MISSING),
        "raise_if_empty": False,
        # Numbers and what parts them are the same bytes in all encodings but one; words beside them are not wanted.
        "encoding": "utf8-lossy",
    }

    def schema(kind: type[pl.DataType]) -> dict[str, type[pl.DataType]]:
        return {str(k): kind if k in how["columns"] else pl.String for k in range(layout.cells)}

    def read(kind: type[pl.DataType], **more: Any) -> pl.DataFrame:
        # No path: releases of Polars before 2.0 take no columns by place where the name holds signs of a pattern.
        with _lines(path, layout) as file:
            return pl.read_csv(file, schema=schema(kind), **how, **more)

    try:
        frame = read(pl.Float64, decimal_comma=layout.decimal_comma)
    except (pl.exceptions.ComputeError, pl.exceptions.SchemaError):
        # Something is not a number: read the words themselves, so that it can be named.
        _refuse_long_rows(path, layout)
        frame = read(pl.String)
        if layout.decimal_comma:
            frame = frame.with_columns(pl.all().str.replace(",", ".", literal=True))
    return frame.select(pl.col(str(own)).alias(name) for name, own in place.items())


def _lines(path: Path, layout: CsvLayout) -> BinaryIO:
    """Return a CSV file in UTF-8 or what its numbers are alike in, with one separator between two cells."""
    if layout.encoding == "utf-16":
        text = path.read_text("utf-16").encode()
    elif layout.separator == " ":
        text = path.read_bytes()
    else:
        return path.open("rb")
    return BytesIO(one_blank(text) if layout.separator == " " else text)


def _schema(path: Path) -> dict[str, pl.DataType]:
    import polars as pl

    with path.open("rb") as file:
        return dict(pl.read_parquet_schema(file))


def _check_parquet(path: Path, schema: Mapping[str, pl.DataType], names: Sequence[str]) -> None:
    """Refuse, before it is unpacked, a file of too many rows or of columns that are no numbers nor words."""
    import polars as pl

    for name in names:
        kind = schema.get(name)
        if kind is not None and not (kind.is_numeric() or kind.is_temporal() or kind == pl.String):
            raise _no_number(path, name, kind)
    rows = pl.scan_parquet(path, glob=False, hive_partitioning=False).select(pl.len()).collect().item()
    check_memory(path, PER_VALUE * rows * len(names))


def _no_number(path: Path, name: str, kind: pl.DataType) -> RecordingError:
    hint = "time in seconds" if name == "time" else "numbers"
    return RecordingError(f"{path}: column {name!r} holds {kind}; it must hold {hint}")


def numbers(path: Path, series: pl.Series) -> Array:
    """Return a column as float64, NaN where it has no value; dates and times of day in s since the first."""
    import polars as pl

    if series.dtype == pl.String:
        check_memory(path, float(series.str.len_bytes().sum() or 0))
        words = series.str.strip_chars()
        numbers = words.cast(pl.Float64, strict=False)
        bad = (numbers.is_null() & words.is_not_null() & (words != "")).arg_true()
        if len(bad):
            stamps = seconds(words)
            if stamps is not None:
                return stamps
            if (wrong := first_wrong(words)) is not None:
                raise RecordingError(
                    f"{path}: column {series.name!r}, row {wrong + 1}: {_short(series[wrong])} is no point in time, "
                    f"unlike most rows; correct it or leave it empty"
                )
            row = int(bad[0])
            raise RecordingError(
                f"{path}: column {series.name!r}, row {row + 1}: {_short(series[row])} is not a number"
                f"{_and_more(len(bad))}; correct it or leave it empty"
            )
        series = numbers
    elif (stamps := seconds(series)) is not None:
        return stamps
    elif not series.dtype.is_numeric():
        raise _no_number(path, series.name, series.dtype)
    values: Array = series.cast(pl.Float64).to_numpy()
    return values


def _refuse_long_rows(path: Path, layout: CsvLayout) -> None:
    width = layout.cells
    with TextIOWrapper(_lines(path, layout), encoding="utf-8", newline="", errors="replace") as file:
        rows = csv.reader(islice(file, layout.first, None), delimiter=layout.separator)
        # A field longer than Python's parser takes is no number, and said to be none where it is wanted.
        with suppress(csv.Error):
            for number, row in enumerate((row for row in rows if row), 1):
                if len(row) > width:
                    raise RecordingError(
                        f"{path}: row {number} has {len(row)} values for {width} columns; correct or remove it"
                    )


def _short(text: str) -> str:
    return repr(text if len(text) <= LONGEST_WORD else f"{text[:LONGEST_WORD]}...")


def damaged_table(path: Path, error: BaseException) -> RecordingError:
    """Return the error that says that a table is not whole."""
    kind = path.suffix.lower().lstrip(".")
    reason = (str(error).strip() or type(error).__name__).splitlines()[0]
    return RecordingError(f"{path}: not a whole {kind} file ({reason}); copy or record it again")


def _and_more(count: int) -> str:
    return f" (and {count - 1} more)" if count > 1 else ""
