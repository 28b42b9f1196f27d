"""Long files: their pieces are those of the whole, parts hold each once, and windows are spread."""

from __future__ import annotations

from itertools import chain, pairwise
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from scara_ident.errors import MemoryLimit
from scara_ident.memory import set_limit
from scara_ident.motion.motion import stretches
from scara_ident.recording import long_file
from scara_ident.recording.long_file import LongFile, cut_long
from scara_ident.recording.long_file import long_file as find
from scara_ident.recording.recording import read_parts, read_recording
from tests.made_recordings import columns, save

WANTED = ("time", "joint1.position")


@pytest.fixture(autouse=True)
def _short(monkeypatch):
    for name, size in {
        "MAX_SAMPLES": 600,
        "PART_SAMPLES": 2_000,
        "KEPT_SAMPLES": 2_000,
        "LONGEST_WHOLE": 4_000,
    }.items():
        monkeypatch.setattr(long_file, name, size)


@pytest.fixture
def gappy(tmp_path) -> Path:
    made = columns(10_000)
    made["time"] += np.where(np.arange(10_000) >= 1_000, 3.0, 0.0) + np.where(np.arange(10_000) >= 6_001, 1.0, 0.0)
    return save(tmp_path / "long_1.parquet", made)


def test_a_file_is_read_in_parts_from_its_length_on_if_it_can_be(robot, gappy, tmp_path, monkeypatch):
    found = find(gappy, "time", WANTED)
    assert found is not None
    assert found.samples == 10_000
    assert find(save(tmp_path / "short.parquet", columns(4_000)), "time", WANTED) is None
    assert find(save(tmp_path / "long.csv", columns(5_000)), "time", WANTED) is None
    monkeypatch.setattr(long_file, "CLOCK_ROWS", 1_000)
    again = find(gappy, "time", WANTED)
    assert again is not None
    assert again.bounds == found.bounds
    assert read_recording(save(tmp_path / "short_2.parquet", columns(4_000)), robot).long is None


def test_a_file_of_one_huge_group_of_rows_is_refused_where_it_takes_too_much_memory(tmp_path):
    set_limit(0.05)
    try:
        path = save(tmp_path / "a.parquet", {"time": np.arange(2_000_000) / 1e3})
        assert find(path, "time", ["time"]) is not None
        pl.DataFrame({"time": np.zeros(3_000_000)}).write_parquet(path, row_group_size=3_000_000)
        with pytest.raises(MemoryLimit, match=r"a\.parquet: .*set_limit"):
            find(path, "time", ["time"])
    finally:
        set_limit(None)


def test_pieces_are_those_that_the_whole_is_cut_into(robot, gappy, monkeypatch):
    monkeypatch.setattr(long_file, "LONGEST_WHOLE", 100_000)
    whole = stretches(read_recording(gappy, robot))
    monkeypatch.undo()
    monkeypatch.setattr(long_file, "MAX_SAMPLES", 600)
    monkeypatch.setattr(long_file, "PART_SAMPLES", 2_000)
    monkeypatch.setattr(long_file, "LONGEST_WHOLE", 4_000)
    found = find(gappy, "time", WANTED)
    assert found is not None
    parts = list(read_parts(found, robot))
    assert len(parts) == len(found.parts) > 4
    pieces = [piece for part in parts for piece in stretches(part)]
    assert len(pieces) == len(whole)
    for one, other in zip(pieces, whole, strict=True):
        assert np.array_equal(one.time, other.time)
        assert np.array_equal(one.position, other.position)
        assert np.array_equal(one.torque, other.torque)


def test_parts_hold_every_row_once_and_are_no_longer_than_they_may_be():
    bounds = tuple(cut_long([0, 500, 5_003, 5_050, 60_001]))
    file = LongFile(Path("a.parquet"), bounds)
    rows = [pair for part in file.parts for pair in pairwise(part)]
    assert rows == list(pairwise(bounds))
    assert max(part[-1] - part[0] for part in file.parts) <= 2_000


def test_windows_are_spread_over_the_file_and_all_of_a_shorter_one(robot, gappy):
    bounds = tuple(cut_long([0, 60_001]))
    file = LongFile(Path("a.parquet"), bounds)
    windows = list(chain(*file.windows))
    assert len(file.windows) == 8
    assert windows == sorted(windows)
    assert (windows[0], windows[-2]) == (0, bounds[-2])
    assert sum(stop - start for start, stop in file.windows) <= 2_000
    assert LongFile(Path("a.parquet"), (0, 1_000, 2_000)).windows == ((0, 1_000, 2_000),)
    kept = read_recording(gappy, robot)
    assert kept.long is not None
    assert len(kept.time) == sum(stop - start for start, stop in kept.long.windows)
    assert (kept.time[0], len(stretches(kept))) == (0.0, 8)
    (finding,) = (finding for finding in kept.findings if finding.kind == "long")
    assert "of its 10000 samples" in finding.message
    assert "gap" not in {finding.kind for finding in kept.findings}


def test_every_effort_that_is_clipped_is_left_out(robot, tmp_path):
    """Only that of the first joint was."""
    made = columns(10_000)
    for joint in ("joint1", "joint2"):
        made[f"{joint}.effort"] = np.minimum(made[f"{joint}.effort"], 0.3)
    recording = read_recording(save(tmp_path / "long_1.parquet", made), robot)
    assert recording.long is not None
    assert {item.clipped for item in recording.findings if item.kind == "saturation"} == {(0, 0.3), (1, 0.3)}


def test_short_pieces_are_kept_together_so_that_windows_are_no_slivers():
    for bounds in ([*range(0, 2_000, 10), 60_000], [*range(0, 30_000, 10), 60_000], [*range(0, 60_001, 100)]):
        windows = LongFile(Path("a.parquet"), tuple(cut_long(bounds))).windows
        sizes = [window[-1] - window[0] for window in windows]
        assert 1_600 <= sum(sizes) <= 2_000
        assert min(sizes) >= 200
        assert all(one[-1] <= other[0] for one, other in pairwise(windows))
        assert all(set(window[:-1]) <= set(cut_long(bounds)) for window in windows)


def test_rows_that_repeat_a_time_are_no_gaps(tmp_path):
    made = {name: np.repeat(values, 3) for name, values in columns(2_000).items()}
    found = find(save(tmp_path / "held.parquet", made), "time", WANTED)
    assert found is not None
    assert len(found.bounds) == 11


def test_windows_of_a_clock_that_starts_again_are_left_out(robot, tmp_path):
    made = columns(10_000)
    made["time"][5_100:] -= made["time"][5_100]
    kept = read_recording(save(tmp_path / "twice_1.parquet", made), robot)
    assert np.all(np.diff(kept.time) > 0.0)
    assert any("time runs backwards" in finding.message for finding in kept.findings)
