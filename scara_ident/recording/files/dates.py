"""Points in time as loggers and spreadsheets write them, in seconds."""

from __future__ import annotations

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


def _parsed(words: pl.Series) -> pl.Series | None:
    import polars as pl

    words = words.str.replace(r"^(\S+)T", "$1 ").str.replace(r",([0-9]+)", ".$1")
    some = words.drop_nulls()
    if not len(some) or not some.str.contains(":").all():
        return None
    zoned = bool(some.str.contains(OFFSET).all())
    if zoned:
        words = words.str.replace("Z$", "+00:00")
    for hours in HOURS:
        for day in DAYS:
            found = words.str.to_datetime(f"{day} {hours}{'%z' if zoned else ''}", time_unit="ns", strict=False)
            if found.null_count() == words.null_count():
                return found.dt.replace_time_zone(None) if zoned else found
        clock = words.str.strptime(pl.Time, hours, strict=False)
        if clock.null_count() == words.null_count():
            return clock
    return None


def _since_first(nanoseconds: pl.Series, *, daily: bool = False) -> Array:
    # Differences of whole numbers: a double of 1.7e18 ns has steps of 256.
    elapsed: Array = (nanoseconds - nanoseconds.drop_nulls().first()).cast(float).to_numpy()
    if daily:
        step = np.diff(elapsed, prepend=elapsed[:1])
        elapsed = elapsed + DAY * np.cumsum(np.nan_to_num(step) < -DAY / 2)
    return np.asarray(elapsed / 1e9)
