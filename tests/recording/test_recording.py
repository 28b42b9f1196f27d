"""Recordings: their names, channels and places, read and written."""

from __future__ import annotations

import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import hypothesis.strategies as st
import numpy as np
import polars as pl
import pytest
from hypothesis import given, settings
from hypothesis.extra.numpy import arrays

from scara_ident.errors import RecordingError
from scara_ident.recording.recording import (
    Recording,
    read_recording,
    split_name,
    write_recording,
)
from scara_ident.robot.robot import load_robot
from tests.made_recordings import columns, save
from tests.recording.made import refusal
from tests.shared import shared_path


@pytest.mark.parametrize(
    ("stem", "trajectory", "repetition"),
    [
        ("OJD_1", "OJD", 1),
        ("OJD_12", "OJD", 12),
        ("OJD", "OJD", 1),
        ("ident_50s_12harm", "ident_50s_12harm", 1),
        ("A0_0815_03", "A0_0815", 3),
        ("OJD_", "OJD_", 1),
        ("_7", "_7", 1),
        ("7", "7", 1),
        ("OJD_1b", "OJD_1b", 1),
        ("OJD_-1", "OJD_-1", 1),
    ],
)
def test_a_stem_is_a_trajectory_and_a_repetition(stem, trajectory, repetition):
    assert split_name(stem) == (trajectory, repetition)


@settings(max_examples=50)
@given(trajectory=st.text(min_size=1), repetition=st.integers(0, 10**9))
def test_split_name_undoes_the_contract(trajectory, repetition):
    assert split_name(f"{trajectory}_{repetition}") == (trajectory, repetition)


def test_rows_stand_in_the_robots_order_whatever_the_files(robot, tmp_path):
    made = columns()
    backwards = {name: made[name] for name in reversed(made)} | {
        "note": np.zeros(4000),
        "joint3.position": np.ones(4000),
    }
    recording = read_recording(save(tmp_path / "OJD_2.parquet", backwards), robot)
    assert (recording.name, recording.trajectory, recording.repetition) == ("OJD_2", "OJD", 2)
    assert recording.joints == ("joint1", "joint2")
    assert recording.path == tmp_path / "OJD_2.parquet"
    assert recording.rate == pytest.approx(1000)
    np.testing.assert_array_equal(recording.position, [made["joint1.position"], made["joint2.position"]])
    swapped = replace(
        robot,
        joints=("joint2", "joint1"),
        lower=robot.lower[::-1],
        upper=robot.upper[::-1],
    )
    recording = read_recording(tmp_path / "OJD_2.parquet", swapped)
    np.testing.assert_array_equal(recording.effort, [made["joint2.effort"], made["joint1.effort"]])


def test_gains_make_torque_of_recorded_effort(robot, tmp_path):
    made = columns()
    gained = replace(robot, effort_gain=np.array([14.87, -0.5]))
    recording = read_recording(save(tmp_path / "a.parquet", made), gained)
    np.testing.assert_allclose(recording.effort, [14.87 * made["joint1.effort"], -0.5 * made["joint2.effort"]])
    np.testing.assert_allclose(
        read_recording(tmp_path / "a.parquet", gained, need_effort=False).effort, recording.effort
    )


def test_optional_columns_are_read_where_every_joint_has_them(robot, tmp_path):
    made = columns()
    for signal in ("velocity", "temperature"):
        made |= {f"{joint}.{signal}": np.arange(4000.0) + k for k, joint in enumerate(("joint1", "joint2"))}
    made["joint2.acceleration"] = np.ones(4000)
    recording = read_recording(save(tmp_path / "a.parquet", made), robot)
    np.testing.assert_array_equal(recording.velocity[1], np.arange(4000.0) + 1)
    assert recording.temperature.shape == (2, 4000)
    assert recording.acceleration is None
    assert [finding.kind for finding in recording.findings] == ["missing_column"]
    assert "joint1.acceleration" in recording.findings[0].message


def test_a_second_encoder_may_be_on_some_joints_only_and_reads_back(robot, tmp_path):
    made = columns()
    made["joint2.link_position"] = made["joint2.position"] + 1e-3
    made["joint2.link_position"][7] = np.nan
    recording = read_recording(save(tmp_path / "a_1.csv", made), robot)
    assert np.isnan(recording.link_position[0]).all()
    np.testing.assert_allclose((recording.link_position - recording.position)[1, 8:], 1e-3, atol=1e-12)
    assert np.isnan(recording.link_position[1, 7])
    assert recording.findings == ()
    write_recording(recording, tmp_path / "b_1.parquet")
    again = read_recording(tmp_path / "b_1.parquet", robot)
    np.testing.assert_array_equal(again.link_position, recording.link_position)
    assert read_recording(save(tmp_path / "c_1.csv", columns()), robot).link_position is None


def test_single_precision_and_whole_numbers_become_double(robot, tmp_path):
    made = {name: values.astype(np.float32) for name, values in columns().items()}
    made["joint1.temperature"] = made["joint2.temperature"] = np.full(4000, 31, dtype=np.int16)
    recording = read_recording(save(tmp_path / "a.parquet", made), robot)
    for values in (recording.time, recording.position, recording.effort, recording.temperature):
        assert values.dtype == np.float64
        assert values.flags.c_contiguous
        assert not values.flags.writeable


def test_a_missing_joint_is_refused_with_those_there_are_and_a_near_name(robot, tmp_path):
    made = {name.replace("joint2", "Joint_2"): values for name, values in columns().items()}
    message = refusal(save(tmp_path / "a.parquet", made), robot)
    assert "no column 'joint2.position' (and 1 more)" in message
    assert "is it 'Joint_2.position'?" in message
    assert "joint1.position, Joint_2.position" in message


def test_missing_time_and_effort_are_refused(robot, tmp_path):
    made = columns()
    made["Time"] = made.pop("time")
    message = refusal(save(tmp_path / "a.parquet", made), robot)
    assert "no column 'time'" in message
    assert "is it 'Time'?" in message
    made = columns()
    del made["joint1.effort"], made["joint2.effort"]
    assert "its effort columns: none" in refusal(save(tmp_path / "a.parquet", made), robot)
    assert read_recording(tmp_path / "a.parquet", robot, need_effort=False).effort is None


def test_an_effort_of_one_joint_only_is_left_out_where_none_is_needed(robot, tmp_path):
    made = columns()
    del made["joint1.effort"]
    recording = read_recording(save(tmp_path / "a.parquet", made), robot, need_effort=False)
    assert recording.effort is None
    assert [finding.kind for finding in recording.findings] == ["missing_column"]


SIGNAL = arrays(np.float64, (2, 60), elements=st.floats(-2.0, 2.0, width=64))


@settings(max_examples=25)
@given(
    suffix=st.sampled_from([".parquet", ".csv"]),
    effort=SIGNAL,
    velocity=st.none() | SIGNAL,
    start=st.floats(-1e4, 1e9),
    gain=arrays(np.float64, 2, elements=st.sampled_from([1.0, -2.0, 14.87, 1e-3])),
)
def test_what_is_written_reads_back(robot, tmp_path_factory, suffix, effort, velocity, start, gain):
    made = columns(60, 0.03)
    noise = np.random.default_rng(0).standard_normal((2, 60))
    recording = Recording(
        name="OJD_3",
        trajectory="OJD",
        repetition=3,
        joints=robot.joints,
        time=start + made["time"],
        position=np.array([made["joint1.position"], made["joint2.position"]]),
        effort=effort + 1e-3 * noise,
        velocity=velocity,
        temperature=np.full((2, 60), 30.1),
    )
    path = tmp_path_factory.mktemp("written") / f"OJD_3{suffix}"
    write_recording(recording, path, effort_gain=gain)
    back = read_recording(path, replace(robot, effort_gain=gain))
    assert (back.name, back.trajectory, back.repetition, back.joints) == ("OJD_3", "OJD", 3, robot.joints)
    for signal in ("time", "position", "velocity", "acceleration", "temperature"):
        np.testing.assert_array_equal(getattr(back, signal), getattr(recording, signal))
    np.testing.assert_allclose(back.effort, recording.effort, rtol=1e-15 * 4)


def test_a_failed_write_leaves_the_old_file_and_nothing_else(robot, tmp_path, monkeypatch):
    path = tmp_path / "OJD_1.parquet"
    recording = read_recording(save(path, columns()), robot)
    before = path.read_bytes()

    def full(_self: object, file: object, **_options: object) -> None:
        file.write(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(pl.DataFrame, "write_parquet", full)
    with pytest.raises(RecordingError, match="No space left on device; make room"):
        write_recording(recording, path)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["OJD_1.parquet"]


def test_writing_replaces_a_file_and_refuses_odd_places(robot, tmp_path):
    path = tmp_path / "OJD_1.parquet"
    recording = read_recording(save(path, columns()), robot)
    write_recording(recording, path)
    np.testing.assert_array_equal(read_recording(path, robot).effort, recording.effort)
    with pytest.raises(RecordingError, match="suffix"):
        write_recording(recording, tmp_path / "OJD_1.xlsx")
    with pytest.raises(RecordingError, match="cannot be written"):
        write_recording(recording, tmp_path / "absent" / "OJD_1.parquet")


def test_a_recording_checks_its_own_shapes():
    time = np.linspace(0.0, 1.0, 11)
    with pytest.raises(RecordingError, match="position has shape"):
        Recording("a", "a", 1, ("joint1",), time, np.zeros((2, 11)))
    with pytest.raises(RecordingError, match="effort has shape"):
        Recording("a", "a", 1, ("joint1",), time, np.zeros((1, 11)), np.zeros((1, 10)))
    with pytest.raises(RecordingError, match="strictly increasing"):
        Recording("a", "a", 1, ("joint1",), time[::-1], np.zeros((1, 11)))


def test_importing_the_reader_loads_no_heavy_library():
    heavy = "{'polars', 'pandas', 'pyarrow', 'pinocchio', 'scipy'}"
    code = f"import sys, scara_ident.recording.recording; print({heavy} & set(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=Path(__file__).parents[2]
    )
    assert done.stdout.strip() == "set()"


def test_measured_currents_become_torques():
    arm = load_robot(shared_path("data", "ur10e", "robot.yaml"))
    path = shared_path("data", "ur10e", "ident_50s_12harm.parquet")
    recording = read_recording(path, arm)
    currents = pl.read_parquet(path, columns=[f"{joint}.effort" for joint in arm.joints])
    for joint, row, gain in zip(arm.joints, recording.effort, (14.87, 13.26, 11.13, 10.62, 11.03, 11.47), strict=True):
        np.testing.assert_allclose(row, gain * currents[f"{joint}.effort"].to_numpy().astype(float))
    assert recording.velocity.shape == recording.position.shape == (6, len(recording.time))
