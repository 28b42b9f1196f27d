"""Points in time as loggers and spreadsheets write them, in seconds."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from scara_ident.arrays import Array

if TYPE_CHECKING:
    import polars as pl

# Day before month is tried first; within one day both give the same differences.
DAYS = ("%Y-%m-%d", "%d.%m.%Y", "%Y/%m/%d", "%d/%m/%Y", "%m/%d/%Y", "%Y%m%d")
HOURS = ("%H:%M:%S%.f", "%I:%M:%S%.f %p")
OFFSET = r"(Z|[+-][0-9]{2}:?[0-9]{2})$"
# In ns.
DAY = 86_400e9


def seconds(series: pl.Series) -> Array | None:
    """Return points in time in s since the first of them, NaN where there is none; None where they are something else.

    Parameters
    ----------
    series : polars.Series, shape (N,)
        Dates with a time of day, times of day, durations, or words that all say one of these in one way: ISO 8601, day
        and month in any usual order, fractions behind a point or a comma. A time of day may run over midnight.
    """
    import polars as pl

    if series.dtype == pl.String:
        found = _parsed(series.str.strip_chars().replace("", None))
        if found is None:
            return None
        series = found
    if series.dtype == pl.Time:
        return _since_first(series.cast(pl.Int64), daily=True)
    if series.dtype == pl.Duration or isinstance(series.dtype, pl.Datetime):
        return _since_first(series.cast(series.dtype.__class__("ns")).cast(pl.Int64))
    return None


def is_date(word: str) -> bool:
    """Tell whether a word is a point in time."""
    import polars as pl

    return seconds(pl.Series([word])) is not None


def first_wrong(words: pl.Series) -> int | None:
    """Return the first row that is no point in time, as 30 February, where most rows are; None where most are something else.

    Parameters
    ----------
    words : polars.Series of str, shape (N,)
    """
    words = words.str.strip_chars().replace("", None)
    given = len(words) - words.null_count()
    if int(words.str.contains(":").sum() or 0) < given / 2:
        return None
    for found in _readings(words):
        wrong = (found.is_null() & words.is_not_null()).arg_true()
        if 0 < len(wrong) < given / 2:
            return int(wrong[0])
    return None


def _parsed(words: pl.Series) -> pl.Series | None:
    some = words.drop_nulls()
    if not len(some) or not some.str.contains(":").all():
        return None
    return next((found for found in _readings(words) if found.null_count() == words.null_count()), None)


def _readings(words: pl.Series) -> Iterator[pl.Series]:
    """Give words as points in time in each way of writing them, null where a word is none."""
    import polars as pl

    words = words.str.replace(r"^(\S+)T", "$1 ").str.replace(r",([0-9]+)", ".$1")
    zoned = bool(words.drop_nulls().str.contains(OFFSET).all())
    if zoned:
        words = words.str.replace("Z$", "+00:00")
    for hours in HOURS:
        for day in DAYS:
            found = words.str.to_datetime(f"{day} {hours}{'%z' if zoned else ''}", time_unit="ns", strict=False)
            yield found.dt.replace_time_zone(None) if zoned else found
        yield words.str.strptime(pl.Time, hours, strict=False)


def _since_first(nanoseconds: pl.Series, *, daily: bool = False) -> Array:
    # Differences of whole numbers: a double of 1.7e18 ns has steps of 256.
    elapsed: Array = (nanoseconds - nanoseconds.drop_nulls().first()).cast(float).to_numpy()
    if daily:
        step = np.diff(elapsed, prepend=elapsed[:1])
        elapsed = elapsed + DAY * np.cumsum(np.nan_to_num(step) < -DAY / 2)
    return np.asarray(elapsed / 1e9)
