"""Lists of numbers in the rows of a table, as data frames save ``q`` of all joints: columns ``q[0]``, ``q[1]``, ..."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from scara_ident.recording.files.arrays import MAX_CHANNELS

if TYPE_CHECKING:
    import polars as pl

_PART = re.compile(r"(?P<name>.*)\[(?P<place>\d+)\]")
# Rows in which the first list is looked for: those of signals that begin later are empty at first.
LOOKED_AT = 10_000


def names_with_parts(path: Path, schema: Mapping[str, pl.DataType]) -> list[str]:
    """Return the names of a Parquet file's columns, a list of numbers by its parts.

    What is no such list, or has more parts than a log has channels, keeps its name alone.
    """
    import polars as pl

    lists = [name for name, kind in schema.items() if _of_numbers(kind)]
    if not lists:
        return list(schema)
    lengths = [
        (pl.col(name).list.len() if isinstance(schema[name], pl.List) else pl.lit(_width(schema[name])))
        .max()
        .alias(name)
        for name in lists
    ]
    rows = pl.scan_parquet(path, glob=False, hive_partitioning=False).select(lists).head(LOOKED_AT)
    counts = rows.select(lengths).collect().row(0, named=True)
    found: list[str] = []
    for name in schema:
        count = counts.get(name) or 0
        found += [f"{name}[{k}]" for k in range(count)] if 0 < count <= MAX_CHANNELS else [name]
    return found


def listed_in(schema: Mapping[str, pl.DataType], names: Sequence[str]) -> dict[str, tuple[str, int]]:
    """Return of which column, and which part of it, each of some names is that is a part of a list."""
    found = {}
    for name in names:
        part = None if name in schema else _PART.fullmatch(name)
        if part is not None and _of_numbers(schema.get(part["name"])):
            found[name] = part["name"], int(part["place"])
    return found


def part_of_list(kind: pl.DataType, name: str, place: int) -> pl.Expr:
    """Return a part of the lists in a column; none where a list has fewer."""
    import polars as pl

    column = pl.col(name)
    part = (
        column.arr.get(place, null_on_oob=True)
        if isinstance(kind, pl.Array)
        else column.list.get(place, null_on_oob=True)
    )
    return part.cast(pl.Float64).alias(f"{name}[{place}]")


def _of_numbers(kind: pl.DataType | None) -> bool:
    import polars as pl

    return isinstance(kind, pl.List | pl.Array) and bool(kind.inner.is_numeric())


def _width(kind: pl.DataType) -> int:
    import polars as pl

    return int(kind.size) if isinstance(kind, pl.Array) else 0
