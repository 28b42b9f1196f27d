"""Bags of ROS give the recording that the contract's Parquet gives."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.errors import RecordingError
from scara_ident.recording.paths import recording_paths
from scara_ident.recording.recording import read_recording, read_recordings
from scara_ident.robot.robot import load_robot
from tests.made_recordings import save
from tests.recording.files.formats import (
    write_bag,
    write_mat,
)
from tests.recording.files.made import MADE, assert_same, described, expected
from tests.recording.made import refusal


@pytest.mark.slow
@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_a_rosbag2_folder_is_one_recording_and_needs_no_mapping(tmp_path, storage):
    bag = write_bag(tmp_path / "run_2", MADE, storage=storage)
    found = read_recording(bag, load_robot())
    assert (found.name, found.trajectory, found.repetition) == ("run_2", "run", 2)
    assert found.findings == ()
    assert_same(found, expected(tmp_path), clock=1e-9)


def test_a_file_of_a_bag_reads_like_its_folder(tmp_path):
    bag = write_bag(tmp_path / "run_2", MADE)
    (file,) = bag.glob("*.mcap")
    assert_same(read_recording(file, load_robot()), expected(tmp_path), clock=1e-9)


def test_folders_and_globs_hold_bags_beside_files(tmp_path):
    logs = tmp_path / "logs"
    logs.mkdir()
    write_bag(logs / "rosbag2_2024-05-01.12.30_2", MADE)
    save(logs / "a_1.csv", MADE)
    write_mat(logs / "b.mat", {"x": 1.0})
    (logs / "deeper").mkdir()
    for word in (logs, str(logs / "*")):
        assert [path.name for path in recording_paths([word])] == ["a_1.csv", "b.mat", "rosbag2_2024-05-01.12.30_2"]
    bag, file = read_recordings([logs / "rosbag2_2024-05-01.12.30_2", logs / "a_1.csv"], load_robot())
    assert bag.name == "rosbag2_2024-05-01.12.30_2"
    assert file.name == "a_1"


def test_joints_that_are_published_apart_and_in_any_order_are_determined_by_name(tmp_path):
    wanted = expected(tmp_path)
    swapped = write_bag(tmp_path / "swapped", MADE, names=("joint2", "joint1"))
    assert_same(read_recording(swapped, load_robot()), wanted, clock=1e-9)
    apart = write_bag(tmp_path / "apart", MADE, apart=True)
    alone = described(tmp_path, "{}", "{joint2: {}}")
    np.testing.assert_allclose(read_recording(apart, alone).position[0], wanted.position[1], rtol=1e-12)


def test_of_several_topics_one_must_be_chosen(tmp_path):
    bag = write_bag(tmp_path / "run", MADE, topics=("/left/joint_states", "/right/joint_states"))
    message = refusal(bag, load_robot())
    assert "/left/joint_states, /right/joint_states" in message
    assert "topic" in message
    assert_same(
        read_recording(bag, described(tmp_path, "{topic: /right/joint_states}")), expected(tmp_path), clock=1e-9
    )
    assert "'/middle'" in refusal(bag, described(tmp_path, "{topic: /middle}"))


def test_unstamped_messages_are_refused_and_read_by_the_recorders_clock(tmp_path):
    bag = write_bag(tmp_path / "run", MADE, stamped=False)
    assert "receive_time" in refusal(bag, load_robot())
    robot = described(tmp_path, "{time: {column: receive_time}}")
    assert_same(read_recording(bag, robot), expected(tmp_path), clock=1e-9)


@pytest.mark.slow
def test_a_damaged_bag_is_refused_in_a_line(tmp_path):
    bag = write_bag(tmp_path / "run", MADE)
    (file,) = bag.glob("*.mcap")
    whole = file.read_bytes()
    random = np.random.default_rng(0)
    refused = 0
    for place in random.integers(8, len(whole) - 8, 12).tolist():
        damaged = bytearray(whole)
        damaged[place : place + 8] = random.bytes(8)
        file.write_bytes(damaged)
        try:
            read_recording(file, load_robot())
        except RecordingError as error:
            refused += 1
            assert "\n" not in str(error)
    assert refused > 0
    file.write_bytes(whole[: len(whole) // 2])
    assert "not a whole" in refusal(file, load_robot())
    (bag / "metadata.yaml").write_text("rosbag2_bagfile_information: {version: 5}\n")
    assert "not a whole" in refusal(bag, load_robot())


def test_a_bag_without_joint_states_says_what_it_has(tmp_path):
    bag = write_bag(tmp_path / "run", MADE, topics=())
    message = refusal(bag, load_robot())
    assert "no sensor_msgs/msg/JointState" in message
    assert "std_msgs/msg/String" in message
