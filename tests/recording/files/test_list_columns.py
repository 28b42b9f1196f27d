"""Lists in the rows of a Parquet file: a column for every part of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from scara_ident.errors import RecordingError
from scara_ident.recording.files.list_columns import listed_in, names_with_parts
from scara_ident.recording.files.parquet_csv import column_names, read_columns
from scara_ident.recording.recording import read_recording
from tests.made_recordings import columns
from tests.recording.files.made import described

TIME = np.arange(40) / 20.0
Q = np.sin(np.outer(TIME, [1.0, 2.0, 3.0]))


def save(path: Path, **more: pl.Series) -> Path:
    frame = pl.DataFrame({"timestamp": TIME, "q": Q.tolist(), "tau": Q.tolist()} | more)
    frame.with_columns(pl.col("tau").cast(pl.Array(pl.Float32, 3))).write_parquet(path)
    return path


def test_every_part_of_a_list_is_a_column(tmp_path: Path):
    """Of a log with a list of all joints in each row every list was 'text'."""
    path = save(tmp_path / "log.parquet", words=pl.Series(["a"] * 40), image=pl.Series([[0] * 200] * 40))
    parts = [f"{name}[{k}]" for name in ("q", "tau") for k in range(3)]
    assert column_names(path) == ("timestamp", *parts, "words", "image")
    found = read_columns(path, ["q[1]", "tau[2]", "timestamp", "q[0]"])
    assert list(found) == ["q[1]", "tau[2]", "timestamp", "q[0]"]
    for name, values in (("q[0]", Q[:, 0]), ("q[1]", Q[:, 1]), ("timestamp", TIME)):
        np.testing.assert_array_equal(found[name], values)
    np.testing.assert_allclose(found["tau[2]"], Q[:, 2], rtol=1e-6)
    with pytest.raises(RecordingError, match="column 'q' holds List"):
        read_columns(path, ["q"])


def test_a_list_that_is_missing_or_shorter_leaves_a_gap(tmp_path: Path):
    rows = [None, [], *Q[2:39].tolist(), [7.0]]
    path = tmp_path / "log.parquet"
    pl.DataFrame({"time": TIME, "q": pl.Series(rows, dtype=pl.List(pl.Float64))}).write_parquet(path)
    assert column_names(path) == ("time", "q[0]", "q[1]", "q[2]")
    found = read_columns(path, ["q[0]", "q[2]"])
    assert np.isnan(found["q[0]"]).nonzero()[0].tolist() == [0, 1]
    assert np.isnan(found["q[2]"]).nonzero()[0].tolist() == [0, 1, 39]
    assert found["q[0]"][39] == 7.0


def test_lists_of_nothing_known_and_names_of_their_kind_keep_them(tmp_path: Path):
    path = tmp_path / "log.parquet"
    pl.DataFrame(
        {"q[0]": TIME, "empty": pl.Series([[]] * 40, dtype=pl.List(pl.Float64)), "q": Q.tolist()}
    ).write_parquet(path)
    with pytest.raises(RecordingError, match=r"column 'q\[0\]' is in the header twice"):
        column_names(path)
    schema = {"q[0]": pl.Float64(), "empty": pl.List(pl.Float64), "q": pl.List(pl.Float64), "words": pl.List(pl.String)}
    assert listed_in(schema, ["q[0]", "q[1]", "x[1]", "words[0]", "q"]) == {"q[1]": ("q", 1)}
    pl.DataFrame({"empty": pl.Series([[]] * 40, dtype=pl.List(pl.Float64)), "a": [[[1.0]]] * 40}).write_parquet(path)
    assert names_with_parts(path, pl.read_parquet_schema(path)) == ["empty", "a"]


def test_a_recording_is_read_by_its_lists(tmp_path: Path):
    made = columns()
    lists = {
        name: np.array([made[f"{joint}.{name}"] for joint in ("joint1", "joint2")]).T.tolist()
        for name in ("position", "effort")
    }
    path = tmp_path / "run_1.parquet"
    pl.DataFrame({"time": made["time"], **lists}).write_parquet(path)
    robot = described(
        tmp_path, "{time: {column: time}, position: {column: 'position[{index}]'}, effort: {column: 'effort[{index}]'}}"
    )
    found = read_recording(path, robot)
    np.testing.assert_array_equal(found.position[1], made["joint2.position"])
    np.testing.assert_array_equal(found.effort[0], made["joint1.effort"])
    assert found.findings == ()
