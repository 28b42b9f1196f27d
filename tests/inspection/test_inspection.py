"""inspect finds an arm's channels under the names and in the units that people use, and says what it does not know."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest
import yaml

from scara_ident.errors import RecordingError, UsageError
from scara_ident.inspection.inspection import Inspection, inspect_file
from scara_ident.inspection.names import meaning
from scara_ident.inspection.values import time_unit
from scara_ident.recording.recording import read_recording
from scara_ident.robot.robot import embedded_urdf, load_robot
from tests.arms import Link, write_urdf
from tests.made_recordings import save
from tests.recording.files.formats import DEGREE, recorded, write_bag, write_mat, write_plotjuggler
from tests.shared import shared_path

MADE = recorded(600)
UR = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint")


# names


@pytest.mark.parametrize(
    ("name", "quantity", "joint", "number", "unit"),
    [
        ("shoulder_pan_joint.position", "position", 0, None, None),
        ("/joint_states/wrist_1_joint/velocity", "velocity", 3, None, None),
        ("elbow.pos [deg]", "position", 2, None, "deg"),
        ("elbow_current_mA", "effort", 2, None, "mA"),
        ("wrist_1_vel_rpm", "velocity", 3, None, "rpm"),
        ("ShoulderLiftTorque", "effort", 1, None, None),
        ("actual_q_0", "position", None, 0, None),
        ("log.qd[3]", "velocity", None, 3, None),
        ("tau_3 (Nm)", "effort", None, 3, "N m"),
        ("joint_2_temperature", "temperature", None, 2, None),
        ("I[2]", "effort", None, 2, None),
        ("I", None, None, None, None),
        ("t_ms", "time", None, None, "ms"),
        ("__time", "time", None, None, None),
        ("actual_TCP_speed_0", None, None, 0, None),
        ("position_error_1", None, None, 1, None),
        ("status", None, None, None, None),
    ],
)
def test_a_name_says_quantity_joint_and_unit(name, quantity, joint, number, unit):
    said = meaning(name, UR)
    assert (said.quantity, said.joint, said.number, said.unit) == (quantity, joint, number, unit)


def test_a_prefix_of_all_joints_may_be_left_out_and_ambiguous_short_names_count_for_none():
    panda = ("panda_joint1", "panda_joint2")
    assert meaning("joint2/pos", panda).joint == 1
    assert meaning("elbow_pos", ("elbow_joint", "elbow_link")).joint is None
    assert meaning("joint10_pos", tuple(f"joint{k}" for k in range(1, 11))).joint == 9


@pytest.mark.parametrize(("unit", "factor"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_a_clocks_unit_is_told_by_its_steps(unit, factor):
    assert time_unit(factor * MADE["time"] + 5 * factor) == unit


def test_what_does_not_grow_is_no_clock():
    assert time_unit(np.zeros(100)) is None
    assert time_unit(np.sin(np.arange(100.0))) is None


# files


def inspected(path: Path, folder: Path, urdf: Path | None = None) -> Inspection:
    return inspect_file(path, urdf=urdf or embedded_urdf(), folder=folder)


def read_back(found: Inspection, folder: Path, side: str = "motor") -> object:
    """Write the description, state the side that it asks for, and read the recording with it."""
    assert found.description is not None
    text = found.description.replace(f"# effort_side: {side}", f"effort_side: {side}")
    (folder / "robot.yaml").write_text(text, encoding="utf-8")
    return read_recording(found.path, load_robot(folder / "robot.yaml"))


def assert_same(found, tmp_path, *, signals=("position", "effort", "velocity")) -> None:
    wanted = read_recording(save(tmp_path / "contract.parquet", MADE), load_robot())
    np.testing.assert_allclose(found.time - found.time[0], wanted.time, rtol=0, atol=5e-7)
    for signal in signals:
        np.testing.assert_allclose(getattr(found, signal), getattr(wanted, signal), rtol=1e-9, atol=1e-9)


def test_the_contracts_columns_need_no_mapping(tmp_path):
    found = inspected(save(tmp_path / "a.parquet", MADE), tmp_path)
    assert found.problems == ()
    assert found.mapping == {}
    assert found.recording is not None
    assert found.recording.findings == ()
    assert {column.name: (column.quantity, column.joint) for column in found.columns}["joint2.effort"] == (
        "effort",
        "joint2",
    )
    assert_same(read_back(found, tmp_path), tmp_path)


def test_the_side_of_effort_is_asked_for_where_there_are_gears(tmp_path):
    urdf = write_urdf(tmp_path / "arm.urdf", (Link(), Link(), Link()), (100.0, -50.5, 1.0))
    made = {name.replace("joint", "j"): values for name, values in MADE.items()}
    found = inspected(save(tmp_path / "a.parquet", made), tmp_path, urdf)
    content = yaml.safe_load(found.description or "")
    assert "effort_side" not in content
    assert "# effort_side: motor" in (found.description or "")
    assert [joint["reduction"] for joint in content["joints"].values()] == [100, -50.5]
    assert content["locked"] == {"j3": 0.0}
    assert any("j3: taken as locked" in note for note in found.notes)


def test_plotjugglers_export_maps_by_one_pattern_a_signal(tmp_path):
    found = inspected(write_plotjuggler(tmp_path / "log.csv", MADE), tmp_path)
    assert found.mapping["time"] == {"column": "__time", "unit": "s"}
    assert found.mapping["position"] == {"column": "/joint_states/{joint}/position", "unit": "rad"}
    assert found.mapping["velocity"] == {"column": "/joint_states/{joint}/velocity", "unit": "rad/s"}
    assert found.recording is not None
    assert_same(read_back(found, tmp_path), tmp_path)


def test_units_are_told_by_limits_and_slopes_where_no_name_says_them(tmp_path):
    made = {"clock": 1e3 * MADE["time"]}
    for number, joint in enumerate(("joint1", "joint2")):
        made[f"J{number} angle"] = MADE[f"{joint}.position"] / DEGREE
        made[f"J{number} speed"] = MADE[f"{joint}.velocity"] * 100 * 60 / (2 * np.pi)
        made[f"J{number} torque"] = MADE[f"{joint}.effort"]
        made[f"J{number} target angle"] = np.zeros(600)
    urdf = two_joints(tmp_path)
    found = inspected(save(tmp_path / "a.csv", made), tmp_path, urdf)
    assert found.problems == ()
    assert found.mapping["time"] == {"column": "clock", "unit": "ms"}
    assert found.mapping["position"] == {"column": "J{index} angle", "unit": "deg"}
    assert found.mapping["velocity"] == {"column": "J{index} speed", "unit": "rpm", "side": "motor"}
    assert any("order" in note for note in found.notes)
    back = read_back(found, tmp_path)
    np.testing.assert_allclose(back.position[1], MADE["joint2.position"], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(back.velocity[0], MADE["joint1.velocity"], rtol=1e-9, atol=1e-9)


def two_joints(folder: Path, reduction: float = 100.0) -> Path:
    links = (Link(), Link(xyz=(0.4, 0.0, 0.0)))
    return write_urdf(folder / "arm.urdf", links, (reduction, reduction))


def test_matrices_of_a_mat_file_are_matched_by_order(tmp_path):
    q, tau = (np.array([MADE[f"{j}.{s}"] for j in ("joint1", "joint2")]) for s in ("position", "effort"))
    path = write_mat(tmp_path / "log.mat", {"t": MADE["time"], "q": q.T, "tau": tau.T})
    found = inspected(path, tmp_path, two_joints(tmp_path))
    assert found.mapping["position"] == {"column": "q[{index}]", "unit": "rad"}
    assert found.mapping["effort"] == {"column": "tau[{index}]", "unit": "N m"}
    assert_same(read_back(found, tmp_path), tmp_path, signals=("position", "effort"))


def test_the_topic_with_the_arms_joints_is_chosen(tmp_path):
    other = {name.replace("joint", "finger"): values for name, values in MADE.items()}
    bag = write_bag(tmp_path / "run", MADE | other, topics=("/b/joint_states",))
    found = inspected(bag, tmp_path)
    assert found.mapping == {}
    two = write_bag(tmp_path / "two", MADE, topics=("/a/joint_states", "/b/joint_states"))
    found = inspected(two, tmp_path)
    assert set(found.topics) == {"/a/joint_states", "/b/joint_states"}
    assert found.mapping == {"topic": found.topic}
    assert_same(read_back(found, tmp_path), tmp_path)


def test_a_current_asks_for_its_gain(tmp_path):
    made = {name.replace("effort", "current"): values for name, values in MADE.items()}
    found = inspected(save(tmp_path / "a.parquet", made), tmp_path, None)
    assert found.mapping["effort"] == {"column": "{joint}.current", "unit": "A"}
    assert "STATE effort_gain, N m per A" in (found.description or "")
    assert_same(read_back(found, tmp_path), tmp_path)


def test_encoder_counts_are_seen_and_their_number_a_turn_asked_for(tmp_path):
    made = {n: np.rint(1e4 * v) if n.endswith("position") else v for n, v in MADE.items()}
    found = inspected(save(tmp_path / "a.parquet", made), tmp_path)
    assert any("counts_per_turn" in problem for problem in found.problems)
    assert found.recording is None


def test_a_file_without_an_arm_says_what_is_missing(tmp_path):
    path = save(tmp_path / "a.parquet", {"x": np.arange(60.0) ** 2 % 7, "y": np.zeros(60)})
    found = inspected(path, tmp_path)
    assert len(found.problems) == 2
    assert "time" in found.problems[0]
    assert "position" in found.problems[1]
    # The draft is still a description that loads, but for the side of effort.
    assert yaml.safe_load(found.description or "")["urdf"]


def test_texts_and_constants_are_listed_as_such(tmp_path):
    frame = pl.DataFrame(MADE | {"zero": np.zeros(600)}).with_columns(pl.lit("running").alias("mode"))
    frame.write_parquet(tmp_path / "a.parquet")
    kinds = {column.name: column.kind for column in inspected(tmp_path / "a.parquet", tmp_path).columns}
    assert (kinds["mode"], kinds["zero"], kinds["joint1.position"]) == ("text", "constant", "numbers")


def test_what_the_audit_refuses_is_said(tmp_path):
    made = MADE | {"joint1.effort": np.zeros(600)}
    found = inspected(save(tmp_path / "a.parquet", made), tmp_path)
    assert found.recording is None
    assert "dead channel" in (found.refusal or "")


def test_a_description_is_checked_on_a_file(tmp_path):
    path = write_plotjuggler(tmp_path / "log.csv", MADE)
    found = inspected(path, tmp_path)
    read_back(found, tmp_path)
    again = inspect_file(path, robot=tmp_path / "robot.yaml")
    assert again.recording is not None
    assert again.description is None
    assert [c.joint for c in again.columns if c.channel and c.quantity == "effort"] == ["joint1", "joint2"]


def test_wrong_words_are_bad_usage_and_wrong_files_an_error(tmp_path):
    path = save(tmp_path / "a.parquet", MADE)
    with pytest.raises(UsageError, match="give one"):
        inspect_file(path, urdf="a.urdf", robot="robot.yaml")
    with pytest.raises(UsageError, match="no such file"):
        inspect_file(tmp_path / "absent.csv")
    with pytest.raises(UsageError, match="is a folder"):
        inspect_file(tmp_path)
    (tmp_path / "a.xlsx").write_bytes(b"x")
    with pytest.raises(RecordingError, match="not known"):
        inspect_file(tmp_path / "a.xlsx")


@pytest.mark.parametrize("arm", ["ur10e", "emps", "double_pendulum_c1"])
def test_measured_files_read_by_the_first_description_as_by_the_published_one(tmp_path, arm):
    published = load_robot(shared_path("data", arm, "robot.yaml"))
    file = {"ur10e": "ident_20s_5harm", "emps": "identification", "double_pendulum_c1": "C1_154220"}[arm]
    path = shared_path("data", arm, f"{file}.parquet")
    found = inspect_file(path, urdf=published.urdf, folder=tmp_path)
    assert found.problems == ()
    back = read_back(found, tmp_path)
    # The gain of a drive is what no file says.
    wanted = read_recording(path, replace(published, effort_gain=np.ones(published.n)))
    assert back.joints == wanted.joints
    np.testing.assert_array_equal(back.position, wanted.position)
    np.testing.assert_array_equal(back.effort, wanted.effort)
