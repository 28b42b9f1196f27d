"""Joints that the model locks and a recording moves are named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.recording.locked import MAX_TRAVEL, locked_channels, moving_though_locked
from scara_ident.recording.recording import read_recording
from scara_ident.robot.description import RobotDescription
from scara_ident.robot.robot import Robot, build_robot, embedded_urdf
from scara_ident.robot.signal_map import Channel, contract_channels
from tests.made_recordings import columns, save
from tests.recording.made import csv_lines, write_text


@pytest.fixture(scope="module")
def first_joint() -> Robot:
    """The SCARA03 of which joint2 is locked at 0.5 rad."""
    described = {"urdf": embedded_urdf(), "effort_side": "motor", "joints": {"joint1": {}}, "locked": {"joint2": 0.5}}
    return build_robot(RobotDescription.model_validate(described), embedded_urdf())


def test_a_joint_that_moves_though_it_is_locked_is_named_with_its_column(first_joint: Robot, tmp_path):
    made = columns(200)
    found = read_recording(save(tmp_path / "run_1.parquet", made), first_joint)
    (finding,) = [item for item in found.findings if item.kind == "moving_lock"]
    low, high = np.min(made["joint2.position"]), np.max(made["joint2.position"])
    assert f"'joint2.position' goes from {low:.3g} to {high:.3g}" in finding.message
    assert "joint2 is locked at 0.5 in the model" in finding.message


@pytest.mark.parametrize("travel", [0.0, 0.9 * MAX_TRAVEL, None])
def test_nothing_is_said_where_it_stands_or_has_no_column(first_joint: Robot, tmp_path, travel: float | None):
    made = columns(200)
    if travel is None:
        del made["joint2.position"]
    else:
        made["joint2.position"] = 0.5 + travel * np.linspace(0.0, 1.0, 200)
    found = read_recording(save(tmp_path / "run_1.parquet", made), first_joint)
    assert not [item for item in found.findings if item.kind == "moving_lock"]


def test_columns_of_locked_joints_are_those_named_as_the_others_are(first_joint: Robot):
    channels = contract_channels(first_joint.joints)
    names = ("time", "joint1.position", "joint2.position", "joint2.effort")
    assert locked_channels(first_joint, channels, names) == {"joint2": Channel("joint2.position")}
    assert locked_channels(first_joint, channels, names[:2]) == {}


def test_travel_is_judged_in_the_unit_of_the_column_and_numbers_that_lack_do_not_count(first_joint: Robot):
    degrees = {"joint2": Channel("q2", np.pi / 180.0)}
    still, moving = np.array([10.0, np.nan, 10.5]), np.array([10.0, np.nan, 10.6])
    assert moving_though_locked(first_joint, degrees, {"q2": still}) == []
    assert len(moving_though_locked(first_joint, degrees, {"q2": moving})) == 1
    assert moving_though_locked(first_joint, degrees, {"q2": np.full(3, np.nan)}) == []


def test_a_column_that_an_identified_joint_has_is_none_of_a_locked_one(first_joint: Robot):
    """Two joints of which one stands in a column named after the locked one: it was taken from its own joint."""
    mapped = contract_channels(("joint1", "elbow"))
    mapped = replace(mapped, position=(mapped.position[0], Channel("joint2.position")))
    robot = replace(first_joint, joints=("joint1", "elbow"))
    assert locked_channels(robot, mapped, ("time", "joint1.position", "joint2.position")) == {}


def test_a_text_in_the_column_of_a_locked_joint_is_no_matter(first_joint: Robot, tmp_path):
    lines = csv_lines(200)
    place = lines[0].split(",").index("joint2.position")
    words = lines[3].split(",")
    words[place] = "off"
    path = write_text(tmp_path / "run_1.csv", [*lines[:3], ",".join(words), *lines[4:]])
    assert len(read_recording(path, first_joint).time) == 200
