"""Rows of a Parquet file without the others."""

from __future__ import annotations

from datetime import datetime, timedelta

import numpy as np
import polars as pl
import pytest

from scara_ident.errors import RecordingError
from scara_ident.recording.files.parquet_csv import read_columns
from scara_ident.recording.files.parquet_rows import read_rows, row_groups, seekable


@pytest.mark.parametrize("writer", ["polars", "pyarrow"])
def test_groups_are_those_that_were_written(tmp_path, writer):
    frame = pl.DataFrame({f"column {k}": np.arange(70_000.0) for k in range(20)} | {"word": ["a"] * 70_000})
    path = tmp_path / "a.parquet"
    if writer == "polars":
        frame.write_parquet(path, row_group_size=30_000)
    else:
        frame.write_parquet(path, row_group_size=30_000, use_pyarrow=True)
    meta = pytest.importorskip("pyarrow.parquet").ParquetFile(path).metadata
    assert row_groups(path) == tuple(meta.row_group(k).num_rows for k in range(meta.num_row_groups))
    assert sum(row_groups(path)) == 70_000


def test_rows_alone_are_those_of_the_whole_with_their_points_in_time(tmp_path):
    path = tmp_path / "a.parquet"
    first = datetime(2024, 5, 1, 23, 59, 59)  # as a logger writes it
    stamps = [first + timedelta(milliseconds=k) for k in range(3_000)]
    numbers = pl.Series("count", range(3_000), dtype=pl.Int32).replace(2_000, None)
    pl.DataFrame({"time": stamps, "count": numbers, "word": ["x"] * 3_000}).write_parquet(path, row_group_size=1_000)
    whole, some = read_columns(path, ["time", "count"]), read_rows(path, ["time", "count"], 1_500, 2_500)
    for name, values in some.items():
        assert np.array_equal(values, whole[name][1_500:2_500], equal_nan=True)
    assert some["time"][0] == 1.5
    assert np.isnan(some["count"][500])
    assert seekable(path, "time", ["time", "count"])
    assert not seekable(path, "time", ["time", "word"])
    assert not seekable(path, "word", ["word", "count"])
    # Where nobody knows when the file began, rows alone do not either.
    pl.DataFrame({"time": [None, *stamps[1:]]}).write_parquet(path)
    assert not seekable(path, "time", ["time"])


def test_a_file_that_is_not_whole_is_refused_in_one_line(tmp_path):
    path = tmp_path / "a.parquet"
    pl.DataFrame({"time": np.zeros(1_000)}).write_parquet(path)
    whole = path.read_bytes()
    for cut in (whole[:-1], whole[:10], b"", whole[:-8] + b"\xff\xff\xff\x00PAR1", b"PAR1" + b"\xff" * 40 + whole[-8:]):
        path.write_bytes(cut)
        with pytest.raises(RecordingError, match=r"a\.parquet: not a whole parquet file \("):
            row_groups(path)


def test_damage_at_the_first_row_of_a_clock_of_dates_is_one_line(tmp_path):
    path = tmp_path / "a.parquet"
    first = datetime(2024, 5, 1)  # as a logger writes it
    pl.DataFrame({"time": [first + timedelta(milliseconds=k) for k in range(1_000)]}).write_parquet(path)
    whole = path.read_bytes()
    path.write_bytes(whole[:4] + b"\xff" * 40 + whole[44:])
    with pytest.raises(RecordingError, match=r"a\.parquet: not a whole parquet file \("):
        seekable(path, "time", ["time"])
