"""Recordings out of arrays and frames are those of files, and what is wrong is said in a line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import polars as pl
import pytest

from scara_ident.errors import ArgumentError, RecordingError
from scara_ident.recording.recording import read_recording
from scara_ident.recording.tables import read_arrays, read_frame
from scara_ident.robot.robot import Robot
from tests.made_recordings import columns, save
from tests.recording.files.formats import DEGREE
from tests.recording.files.made import described

MADE = columns(400)
TIME = MADE["time"]
POSITION, EFFORT = (np.stack([MADE[f"{j}.{s}"] for j in ("joint1", "joint2")], axis=1) for s in ("position", "effort"))


def test_arrays_give_what_the_file_gives(robot: Robot, tmp_path: Path):
    wanted = read_recording(save(tmp_path / "run_2.parquet", MADE), robot)
    found = read_arrays(TIME, POSITION.tolist(), EFFORT, robot, name="run_2")
    assert (found.name, found.trajectory, found.repetition, found.path) == ("run_2", "run", 2, None)
    for signal in ("time", "position", "effort"):
        np.testing.assert_array_equal(getattr(found, signal), getattr(wanted, signal))
    assert read_arrays(TIME, POSITION, None, robot).effort is None


def test_of_arrays_a_mapping_is_said_to_change_nothing(robot: Robot, tmp_path: Path):
    """What a note advised to write under ``recording`` was followed to the letter, and given again."""
    mapped = described(tmp_path, "{position: {offset: {joint2: -1.5708}}}")
    found = read_arrays(TIME, POSITION, EFFORT, mapped)
    np.testing.assert_array_equal(found.position, POSITION.T)
    (said,) = (item.message for item in found.findings if item.kind == "mapping")
    assert "change the arrays instead" in said
    assert not [item for item in read_arrays(TIME, POSITION, EFFORT, robot).findings if item.kind == "mapping"]


def test_points_in_time_count_from_the_first(robot: Robot):
    stamps = np.datetime64("2026-03-01T10:00") + (1e6 * TIME).round().astype("timedelta64[us]")
    np.testing.assert_allclose(read_arrays(stamps, POSITION, EFFORT, robot).time, TIME - TIME[0], atol=1e-9)


@pytest.mark.parametrize("make", [pl.DataFrame, pd.DataFrame])
def test_frames_go_through_the_robots_mapping(tmp_path: Path, make: Callable[[Any], Any]):
    mapped = described(tmp_path, "{time: {column: t, unit: ms}, position: {column: 'q{number}', unit: deg}}")
    made = {"t": 1e3 * TIME, "q1": POSITION[:, 0] / DEGREE, "q2": POSITION[:, 1] / DEGREE, "mode": ["on"] * 400}
    made |= {f"joint{k + 1}.effort": EFFORT[:, k] for k in range(2)}
    found = read_frame(make(made), mapped)
    np.testing.assert_allclose(found.position.T, POSITION, rtol=1e-12)
    np.testing.assert_array_equal(found.effort.T, EFFORT)


def test_the_index_of_pandas_is_the_time_where_no_column_is(robot: Robot):
    frame = pd.DataFrame({name: values for name, values in MADE.items() if name != "time"})
    dated = frame.set_index(pd.Timestamp("2023-11-20 10:33:21.1") + pd.to_timedelta(TIME, unit="s"))
    np.testing.assert_allclose(read_frame(dated, robot).time, TIME, rtol=0, atol=2e-9)
    np.testing.assert_array_equal(read_frame(frame.set_index(pd.Index(TIME, name="time")), robot).time, TIME)
    with pytest.raises(RecordingError, match="frame: no column 'time'"):
        read_frame(frame, robot)


@pytest.mark.parametrize(
    ("arguments", "error", "said"),
    [
        (
            (TIME, POSITION.T, EFFORT),
            RecordingError,
            r"position has shape \(2, 400\); expected \(400, 2\).*transpose it",
        ),
        ((TIME, POSITION, EFFORT[:-1]), RecordingError, r"effort has shape \(399, 2\); expected \(400, 2\)"),
        ((TIME, POSITION[:, :1], EFFORT), RecordingError, "a column for each of joint1, joint2"),
        ((TIME[:, None], POSITION, EFFORT), RecordingError, r"time has shape \(400, 1\)"),
        ((TIME, POSITION + 0j, EFFORT), ArgumentError, "position holds complex128; expected real numbers"),
        ((TIME, [[1.0], [1.0, 2.0]], EFFORT), ArgumentError, "rows of different lengths"),
        ((1e3 * TIME, POSITION, EFFORT), RecordingError, "looks like milliseconds"),
        ((TIME, POSITION / DEGREE, EFFORT), RecordingError, "looks like degrees"),
    ],
)
def test_what_arrays_lack_is_said(robot: Robot, arguments, error, said: str):
    with pytest.raises(error, match=said):
        read_arrays(*arguments, robot)


def test_a_lazy_frame_is_to_be_collected(robot: Robot):
    with pytest.raises(ArgumentError, match=r"a LazyFrame, whose rows are not computed yet; give its collect\(\)"):
        read_frame(pl.DataFrame(MADE).lazy(), robot)


@pytest.mark.parametrize("frame", [{"time": TIME}, POSITION, "run.csv", None])
def test_what_is_no_frame_is_refused_as_a_type(robot: Robot, frame: object):
    with pytest.raises(TypeError, match="expected a data frame of polars or pandas; found"):
        read_frame(frame, robot)


def test_columns_of_frames_that_are_no_numbers_are_named(robot: Robot):
    with pytest.raises(RecordingError, match=r"frame: column 'joint1.effort' holds"):
        read_frame(pd.DataFrame(MADE | {"joint1.effort": ["off"] * 400}), robot)
    with pytest.raises(ArgumentError, match="robot: expected a Robot, as load_robot gives; found str"):
        read_frame(pl.DataFrame(MADE), "robot.yaml")
