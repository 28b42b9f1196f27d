"""Every format gives the recording that the contract's Parquet gives."""

from __future__ import annotations

import builtins
import importlib
from pathlib import Path

import numpy as np
import pytest

from scara_ident.errors import RecordingError
from scara_ident.recording.files import column_names, read_columns
from scara_ident.recording.recording import Recording, read_recording, read_recordings, recording_paths
from scara_ident.robot.robot import Robot, embedded_urdf, load_robot
from tests.made_recordings import save
from tests.recording.files.formats import (
    DEGREE,
    JOINTS,
    recorded,
    write_bag,
    write_hdf5,
    write_mat,
    write_mat73,
    write_plotjuggler,
)

MADE = recorded()


def described(folder: Path, recording: str, joints: str = "{joint1: {}, joint2: {}}") -> Robot:
    path = folder / "robot.yaml"
    text = f"urdf: {embedded_urdf()}\neffort_side: motor\njoints: {joints}\nrecording: {recording}\n"
    path.write_text(text, encoding="utf-8")
    return load_robot(path)


def expected(folder: Path) -> Recording:
    return read_recording(save(folder / "expected.parquet", MADE), load_robot())


def assert_same(found: Recording, wanted: Recording, *, clock: float = 1e-12) -> None:
    assert found.joints == wanted.joints
    np.testing.assert_allclose(found.time - found.time[0], wanted.time - wanted.time[0], rtol=0, atol=clock)
    for signal in ("position", "effort", "velocity"):
        np.testing.assert_allclose(getattr(found, signal), getattr(wanted, signal), rtol=1e-12, atol=1e-12)


def stacked(signal: str, factor: float = 1.0) -> np.ndarray:
    return factor * np.array([MADE[f"{joint}.{signal}"] for joint in JOINTS])


def refusal(path: Path, robot: Robot) -> str:
    with pytest.raises(RecordingError) as caught:
        read_recording(path, robot)
    message = str(caught.value)
    assert "\n" not in message
    assert path.name in message
    return message


# bags


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


def test_joints_that_are_published_apart_and_in_any_order_are_told_by_name(tmp_path):
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


# MATLAB

ARRAYS = "{time: {column: log.t}, position: {column: 'log.q[{index}]', unit: deg}, \
effort: {column: 'log.tau[{index}]', unit: mN m}, velocity: {column: 'log.qd[{index}]', unit: deg/s}}"


@pytest.mark.parametrize("version", ["5", "7.3"])
@pytest.mark.parametrize("across", [False, True])
def test_matrices_in_a_struct_of_a_mat_file_are_channels_whichever_axis_is_time(tmp_path, version, across):
    log = {
        "t": MADE["time"][None],
        "q": stacked("position", 1 / DEGREE),
        "qd": stacked("velocity", 1 / DEGREE),
        "tau": stacked("effort", 1e3),
        "Ts": np.array([[2e-3]]),
    }
    log = {name: values.T if across else values for name, values in log.items()}
    if version == "5":
        path = write_mat(tmp_path / "log_3.mat", {"log": log, "note": "by hand"})
    else:
        path = write_mat73(tmp_path / "log_3.mat", {f"log.{name}": values for name, values in log.items()})
    assert set(column_names(path)) == {"log.t", *(f"log.{s}[{k}]" for s in ("q", "qd", "tau") for k in (0, 1))}
    found = read_recording(path, described(tmp_path, ARRAYS))
    assert found.repetition == 3
    assert_same(found, expected(tmp_path))


def test_columns_of_different_lengths_are_refused_by_both(tmp_path):
    path = write_mat(tmp_path / "a.mat", {"t": MADE["time"], "q": stacked("position"), "tau": stacked("effort")[:, 1:]})
    robot = described(
        tmp_path, "{time: {column: t}, position: {column: 'q[{index}]'}, effort: {column: 'tau[{index}]'}}"
    )
    message = refusal(path, robot)
    assert "400" in message
    assert "399" in message


def test_a_mat_file_without_arrays_or_whole_is_refused(tmp_path):
    assert "no column of numbers" in refusal(write_mat(tmp_path / "a.mat", {"note": "text"}), load_robot())
    path = write_mat(tmp_path / "b.mat", {"t": MADE["time"]})
    path.write_bytes(path.read_bytes()[:300])
    assert "not a whole mat file" in refusal(path, load_robot())
    path.write_bytes(b"")
    assert "empty" in refusal(path, load_robot())


# HDF5


def test_data_sets_of_hdf5_are_told_by_their_path(tmp_path):
    content = {"arm/t_ns": np.rint(MADE["time"] * 1e9).astype(np.int64)}
    for joint in JOINTS:
        content[f"arm/{joint}/turns"] = MADE[f"{joint}.position"] / (2 * np.pi)
        content[f"arm/{joint}/velocity"] = MADE[f"{joint}.velocity"]
        content[f"arm/{joint}/effort"] = MADE[f"{joint}.effort"]
    path = write_hdf5(tmp_path / "log.h5", content)
    robot = described(
        tmp_path,
        "{time: {column: arm/t_ns, unit: ns}, position: {column: 'arm/{joint}/turns', unit: turn}, "
        "velocity: {column: 'arm/{joint}/velocity'}, effort: {column: 'arm/{joint}/effort'}}",
    )
    assert_same(read_recording(path, robot), expected(tmp_path))


def test_fields_of_a_table_in_hdf5_are_columns(tmp_path):
    import h5py

    table = np.zeros(5, dtype=[("t", "f8"), ("q", "f4", (3,)), ("label", "S4")])
    table["t"], table["q"][:, 1] = np.arange(5), 7.0
    with h5py.File(tmp_path / "a.hdf5", "w") as file:
        file["log"] = table
    assert column_names(tmp_path / "a.hdf5") == ("log.t", "log.q[0]", "log.q[1]", "log.q[2]")
    np.testing.assert_array_equal(read_columns(tmp_path / "a.hdf5", ["log.q[1]"])["log.q[1]"], np.full(5, 7.0))


def test_a_damaged_hdf5_file_is_refused(tmp_path):
    path = tmp_path / "a.h5"
    path.write_bytes(b"not at all")
    assert "not a whole h5 file" in refusal(path, load_robot())
    whole = write_hdf5(path, {"t": MADE["time"]})
    whole.write_bytes(whole.read_bytes()[:900])
    assert "not a whole h5 file" in refusal(path, load_robot())


# comma-separated values

PLOTJUGGLER = "{time: {column: __time}, position: {column: '/joint_states/{joint}/position'}, \
velocity: {column: '/joint_states/{joint}/velocity'}, effort: {column: '/joint_states/{joint}/effort'}}"


def test_rows_of_other_signals_in_plotjugglers_csv_are_none_of_the_arms(tmp_path):
    path = write_plotjuggler(tmp_path / "log.csv", MADE)
    found = read_recording(path, described(tmp_path, PLOTJUGGLER))
    assert found.findings == ()
    # A double of 1.7e9 s has steps of 0.24 us.
    assert_same(found, expected(tmp_path), clock=5e-7)


def test_a_value_that_lacks_in_a_row_of_the_arm_is_found_by_its_row_among_the_arms(tmp_path):
    path = write_plotjuggler(tmp_path / "log.csv", MADE)
    lines = path.read_text().splitlines()
    cells = lines[3].split(",")
    assert cells[1]
    lines[3] = ",".join([cells[0], "", *cells[2:]])  # the second of the arm's, behind one of another signal
    path.write_text("\n".join(lines) + "\n")
    (finding,) = read_recording(path, described(tmp_path, PLOTJUGGLER)).findings
    assert finding.kind == "nan"
    assert "row 2" in finding.message


def test_blanks_separate_where_nothing_else_does(tmp_path):
    names = ["timestamp", "actual_q_0", "actual_q_1", "actual_current_0", "actual_current_1"]
    table = [MADE["time"], *stacked("position"), *stacked("effort", 0.5)]
    lines = [" ".join(names), *(" ".join(f"{v:.17g}" for v in row) for row in zip(*table, strict=True))]
    (tmp_path / "rtde.csv").write_text("\n".join(lines) + "\n")
    robot = described(
        tmp_path,
        "{time: {column: timestamp}, position: {column: 'actual_q_{index}'}, "
        "effort: {column: 'actual_current_{index}', unit: A}}",
        "{joint1: {effort_gain: 2}, joint2: {effort_gain: 2}}",
    )
    found = read_recording(tmp_path / "rtde.csv", robot)
    np.testing.assert_allclose(found.effort, stacked("effort"), rtol=1e-12)
    np.testing.assert_array_equal(found.position, stacked("position"))


# what is missing


def test_a_missing_channel_is_named_with_the_key_to_correct(tmp_path):
    path = write_plotjuggler(tmp_path / "log.csv", MADE)
    wrong = described(tmp_path, PLOTJUGGLER.replace("{joint}/effort", "{joint}/torque"))
    message = refusal(path, wrong)
    assert "'/joint_states/joint1/torque'" in message
    assert "recording: effort" in message
    wrong = described(tmp_path, PLOTJUGGLER.replace("{joint}/velocity", "{joint}/speed"))
    assert "recording: velocity" in refusal(path, wrong)
    wrong = described(tmp_path, PLOTJUGGLER.replace("__time", "tine"))
    assert "recording: time" in refusal(path, wrong)


def test_a_file_of_other_names_points_to_inspect(tmp_path):
    message = refusal(write_plotjuggler(tmp_path / "log.csv", MADE), load_robot())
    assert "scara-ident inspect log.csv" in message


def test_a_unit_that_is_wrong_is_caught_by_the_audit(tmp_path):
    made = {name: values / DEGREE if name.endswith("position") else values for name, values in MADE.items()}
    path = save(tmp_path / "a.parquet", made)
    assert "degrees" in refusal(path, described(tmp_path, "{}"))
    found = read_recording(path, described(tmp_path, "{position: {unit: deg}}"))
    np.testing.assert_allclose(found.position, stacked("position"), rtol=1e-12)


@pytest.mark.parametrize(
    ("name", "module", "extra"), [("a.h5", "h5py", "hdf5"), ("a.mcap", "rosbags.highlevel", "ros")]
)
def test_a_library_that_is_not_installed_is_named_with_its_extra(tmp_path, monkeypatch, name, module, extra):
    real = importlib.import_module

    def without(wanted: str, package: str | None = None) -> object:
        if wanted.startswith(module.partition(".")[0]):
            raise ImportError(wanted)
        return real(wanted, package)

    monkeypatch.setattr("scara_ident.recording.files.files.import_module", without)
    (tmp_path / name).write_bytes(b"x")
    message = refusal(tmp_path / name, load_robot())
    assert f'pip install "scara-ident[{extra}]"' in message


def test_an_unknown_suffix_lists_the_known_ones(tmp_path):
    (tmp_path / "log.xlsx").write_bytes(b"x")
    message = refusal(tmp_path / "log.xlsx", load_robot())
    assert ".mat" in message
    assert ".mcap" in message


def test_no_reader_is_loaded_before_its_format_is_read(tmp_path, monkeypatch):
    real = builtins.__import__
    seen: list[str] = []

    def watched(name: str, *rest: object) -> object:
        seen.append(name.partition(".")[0])
        return real(name, *rest)

    path = save(tmp_path / "a.parquet", MADE)
    monkeypatch.setattr(builtins, "__import__", watched)
    read_recording(path, load_robot())
    assert not {"h5py", "rosbags"} & set(seen)
