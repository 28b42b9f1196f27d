"""All checks together, also on measured recordings."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.errors import RecordingError
from scara_ident.recording.recording import read_recording, read_recordings
from scara_ident.robot.robot import load_robot
from tests.made_recordings import columns
from tests.recording.audit.made import kinds
from tests.shared import shared_path


def test_a_faultless_recording_has_no_findings_and_keeps_every_sample(read):
    made = columns()
    recording = read(made)
    assert recording.findings == ()
    np.testing.assert_array_equal(recording.time, made["time"])
    np.testing.assert_array_equal(recording.position[1], made["joint2.position"])
    np.testing.assert_array_equal(recording.effort[0], made["joint1.effort"])


def test_faults_add_up_and_rows_are_named_as_in_the_file(read):
    made = columns()
    made["joint1.effort"][10] = np.nan
    made["time"][20] = made["time"][19]
    made["joint2.position"][30] += 1.0
    made["joint1.position"] += 0.2
    recording = read(made)
    assert kinds(recording) == ["nan", "repeated_time", "spike"]
    assert "row 11" in recording.findings[0].message
    assert "row 21" in recording.findings[1].message
    assert "row 31" in recording.findings[2].message
    np.testing.assert_array_equal(recording.time, np.delete(made["time"], [10, 20, 30]))
    np.testing.assert_array_equal(recording.effort[1], np.delete(made["joint2.effort"], [10, 20, 30]))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("folder", "count", "expected"),
    [
        ("emps", 2, set()),
        ("ur10e", 13, {"jitter", "idle_joint"}),
        ("double_pendulum_c1", 10, {"dropped", "idle_joint"}),
        ("double_pendulum_a0", 9, {"dropped", "jitter", "limits"}),
    ],
)
def test_measured_recordings_are_read_with_few_and_true_findings(folder, count, expected):
    arm = load_robot(shared_path("data", folder, "robot.yaml"))
    recordings = read_recordings([shared_path("data", folder)], arm)
    assert len(recordings) == count
    seen = {finding.kind for recording in recordings for finding in recording.findings}
    assert seen <= expected
    assert all(len(recording.findings) <= 2 for recording in recordings)


def test_of_the_joints_of_a_jointwise_run_only_the_one_that_moves_is_not_idle():
    arm = load_robot(shared_path("data", "ur10e", "robot.yaml"))
    recording = read_recording(shared_path("data", "ur10e", "jointwise_1.parquet"), arm)
    idle = next(finding for finding in recording.findings if finding.kind == "idle_joint")
    assert idle.count == 5
    assert "shoulder_pan_joint" not in idle.message


def test_measured_recordings_in_degrees_are_refused(tmp_path):
    import polars as pl

    arm = load_robot(shared_path("data", "ur10e", "robot.yaml"))
    frame = pl.read_parquet(shared_path("data", "ur10e", "ident_40s_12harm.parquet"))
    path = tmp_path / "degrees.parquet"
    frame.with_columns(pl.col(f"{joint}.position") * 180 / np.pi for joint in arm.joints).write_parquet(path)
    with pytest.raises(RecordingError, match="degrees"):
        read_recording(path, arm)


@pytest.mark.slow
def test_the_cases_are_read_without_a_finding(robot):
    folders = sorted(shared_path("cases").glob("*/train"))
    for folder in folders:
        for recording in read_recordings([folder], robot):
            assert recording.findings == ()
