"""Channels and units are found where names do not say them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest
import yaml

from tests.arms import Link, write_urdf
from tests.inspection.made import MADE, assert_same, inspected, read_back
from tests.made_recordings import save
from tests.recording.files.formats import DEGREE, write_bag, write_mat


def test_units_are_determined_by_limits_and_slopes_where_no_name_says_them(tmp_path):
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


def test_the_velocity_of_a_fast_joint_in_a_slow_log_is_that_of_its_positions(tmp_path):
    """Over the rows that tell a slope a joint turned round, and the velocity in their middle was another by 11 %."""
    time = np.arange(700) / 30.0
    made = {"time": time}
    for number, (size, speed) in enumerate(((0.5, 2.0), (0.4, 4.0)), start=1):
        made[f"j{number}.position"] = size * np.sin(speed * time)
        made[f"j{number}.velocity"] = size * speed * np.cos(speed * time)
        made[f"j{number}.effort"] = np.cos(speed * time)
    found = inspected(save(tmp_path / "a.csv", made), tmp_path, two_joints(tmp_path))
    assert not any("velocity" in note for note in found.notes)
    assert [column.name for column in found.columns if not column.channel] == []


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


def test_short_names_of_controllers_are_positions_and_currents(tmp_path):
    q, tau = (np.array([MADE[f"{j}.{s}"] for j in ("joint1", "joint2")]) for s in ("position", "effort"))
    path = write_mat(tmp_path / "log.mat", {"t": MADE["time"], "ActPos": q.T, "ActCur": tau.T})
    found = inspected(path, tmp_path, two_joints(tmp_path))
    assert found.mapping["position"] == {"column": "ActPos[{index}]", "unit": "rad"}
    assert found.mapping["effort"] == {"column": "ActCur[{index}]", "unit": "A"}


@pytest.mark.slow
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


def test_positions_and_efforts_in_files_of_their_own_are_to_be_put_into_one(tmp_path):
    urdf = two_joints(tmp_path)
    parts = {kind: {name: values for name, values in MADE.items() if kind in name} for kind in ("position", "effort")}
    positions = inspected(save(tmp_path / "q.csv", {"time": MADE["time"], **parts["position"]}), tmp_path, urdf)
    assert any("no efforts found" in note and "side by side in one" in note for note in positions.notes)
    efforts = inspected(save(tmp_path / "tau.csv", {"time": MADE["time"], **parts["effort"]}), tmp_path, urdf)
    assert any("no positions found" in problem and "side by side in one" in problem for problem in efforts.problems)
    neither = inspected(save(tmp_path / "t.csv", {"time": MADE["time"]}), tmp_path, urdf)
    assert not any("side by side" in problem for problem in neither.problems)


@pytest.mark.parametrize(
    ("kind", "angle", "position", "taken"),
    [
        ("prismatic", "angle", "position", "position"),
        ("prismatic", "pos_deg", "pos_mm", "pos_mm"),
        ("revolute", "pos_deg", "pos_mm", "pos_deg"),
    ],
)
def test_of_a_cart_and_its_pole_the_position_is_of_what_slides(tmp_path, kind, angle, position, taken):
    """The angle of the pole was taken for that of the cart, in mm, as it came first; a length in mm for an angle."""
    made = {"time": MADE["time"]}
    for name in (angle, position) if kind == "prismatic" else (position, angle):
        made[name] = 0.3 * MADE["joint1.position" if name == position else "joint2.position"]
    made["force"] = MADE["joint1.effort"]
    found = inspected(save(tmp_path / "a.csv", made), tmp_path, write_urdf(tmp_path / "arm.urdf", (Link(kind),)))
    assert found.mapping["position"]["column"] == taken


@pytest.mark.parametrize(
    ("name", "unit"), [("/joint_states/{joint}/{signal}", "rad"), ("/arm/{joint}/{signal}", "deg")]
)
def test_positions_of_joint_states_are_in_si_however_far_they_wind(tmp_path, name, unit):
    """A motor that stood at 327 rad was read in degrees, as one without limits turns less."""
    made = {"time": MADE["time"]}
    for key, values in MADE.items():
        if key != "time":
            joint, signal = key.split(".")
            wound = 327.0 if key == "joint1.position" else 0.0
            made[name.format(joint=joint.replace("joint", "j"), signal=signal)] = values + wound
    urdf = write_urdf(tmp_path / "arm.urdf", (Link("continuous"), Link("continuous")))
    found = inspected(save(tmp_path / "a.csv", made), tmp_path, urdf)
    assert found.mapping["position"]["unit"] == unit


def learning_data(position, **more):
    """Columns as LeRobot writes them."""
    rows = range(len(MADE["time"]))
    return {
        "action": (position + 0.01).tolist(),
        "observation.environment_state": np.tile(np.sin(MADE["time"]), (7, 1)).T.tolist(),
        "observation.state": position.tolist(),
        "timestamp": MADE["time"],
        "frame_index": list(rows),
        "episode_index": [0 for _ in rows],
        **more,
    }


@pytest.mark.parametrize(("factor", "unit"), [(1.0, "rad"), (1.0 / DEGREE, "deg")])
def test_the_state_of_data_for_learning_is_positions(tmp_path, factor, unit):
    """No positions were found in observation.state, and what such files lack, the efforts, was not said."""
    position = np.array([MADE["joint1.position"], MADE["joint2.position"]]).T * factor
    path = tmp_path / "a.parquet"
    pl.DataFrame(learning_data(position)).write_parquet(path)
    found = inspected(path, tmp_path, two_joints(tmp_path))
    assert found.problems == ()
    assert found.mapping["time"]["column"] == "timestamp"
    assert found.mapping["position"] == {"column": "observation.state[{index}]", "unit": unit}
    assert any("observation.state[{index}] taken as positions" in note for note in found.notes)
    (lacking,) = (note for note in found.notes if "effort" in note)
    assert lacking.startswith("no efforts found, so this file cannot be used to identify")


def test_a_state_beside_efforts_is_a_recording_and_beside_positions_is_none(tmp_path):
    position = np.array([MADE["joint1.position"], MADE["joint2.position"]]).T
    effort = np.array([MADE["joint1.effort"], MADE["joint2.effort"]]).T.tolist()
    path = tmp_path / "a.parquet"
    pl.DataFrame(learning_data(position, **{"observation.torque": effort})).write_parquet(path)
    back = read_back(inspected(path, tmp_path, two_joints(tmp_path)), tmp_path)
    np.testing.assert_allclose(back.position[0], MADE["joint1.position"], rtol=1e-12)
    pl.DataFrame(learning_data(0.0 * position, **{"observation.position": position.tolist()})).write_parquet(path)
    found = inspected(path, tmp_path, two_joints(tmp_path))
    assert found.mapping["position"]["column"] == "observation.position[{index}]"
    assert not any("observation.state" in note for note in found.notes)
