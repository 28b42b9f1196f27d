import json
import re
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
import yaml

from scara_ident.errors import ScaraIdentError, UsageError
from scara_ident.excitation import (
    Condition,
    Effort,
    design_excitation,
    excitation_dict,
    limits_of,
    write_joint_trajectory,
    write_trajectory,
)
from scara_ident.excitation.curves import make_basis
from scara_ident.excitation.output import joint_trajectory_yaml, notes
from scara_ident.files import plain
from scara_ident.model.model import build_model
from scara_ident.report.pictures import design_figures
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import ReferenceMotion
from tests.arms import ur5


@pytest.fixture(scope="module")
def made():
    effort = Effort(starts=1, rounds=0, processes=1)
    return design_excitation(
        build_model(load_robot()), duration=4.0, harmonics=6, samples=400, trajectories=2, effort=effort
    )


@pytest.mark.slow
def test_the_csv_is_what_the_contract_says(made, tmp_path):
    path = tmp_path / "new" / "trajectory.csv"
    write_trajectory(made.trajectories[0], path)
    table = pl.read_csv(path)
    kinds = ("position", "velocity", "acceleration")
    assert table.columns == ["time", *(f"{joint}.{kind}" for joint in ("joint1", "joint2") for kind in kinds)]
    assert table.height == 4001
    time = table["time"].to_numpy()
    np.testing.assert_allclose(np.diff(time), 1e-3, rtol=1e-9)
    q, v, a = made.trajectories[0].at(time)
    np.testing.assert_allclose(table["joint2.position"].to_numpy(), q[1], atol=1e-12)
    motion = ReferenceMotion("x", ("joint1", "joint2"), time, q, v, a)
    # The interpolation through values and derivatives agrees with the motion: they belong together.
    between = 0.5 * (time[1:] + time[:-1])
    np.testing.assert_allclose(motion.at(between).position, made.trajectories[0].at(between)[0], atol=1e-9)


@pytest.mark.slow
def test_a_rate_too_low_for_the_motion_is_said(made, tmp_path):
    with pytest.raises(UsageError, match=r"rate 3 Hz: this motion reaches 1\.5 Hz and needs at least 6 Hz; use fewer"):
        write_trajectory(made.trajectories[0], tmp_path / "t.csv", rate=3.0)
    with pytest.raises(ScaraIdentError, match="suffix"):
        write_trajectory(made.trajectories[0], tmp_path / "t.txt")


@pytest.mark.slow
def test_ros_2_gets_points_enough_for_a_fast_motion(made):
    fast = replace(made.trajectories[0], basis=make_basis(0.25, 6))
    points = yaml.safe_load(joint_trajectory_yaml(fast))["points"]
    assert len(points) == 0.25 * 240 + 1


@pytest.mark.slow
def test_rotors_that_nobody_stated_are_named_with_what_they_would_make_of_a_torque():
    """They are most of what a geared joint moves: limits were said to hold with a third of the torque that was then asked for."""
    model = build_model(ur5(), "basic")
    effort = Effort(starts=1, rounds=0, processes=1)
    limits = limits_of(model.robot, clearance=None)
    made = design_excitation(model, duration=4.0, harmonics=3, samples=200, limits=limits, effort=effort)
    (said,) = (line for line in notes(made) if line.startswith("Torques"))
    assert "without the rotors of shoulder_pan_joint, " in said
    worst = re.search(r"(\w+) would reach about (\S+) N m of (\S+)\), without friction", said)
    assert worst is not None
    joint = model.robot.joint_index(worst[1])
    motion = made.motion(rate=100.0)
    body = model.robot.rotor_guess.armature[joint] * motion.a[joint]
    assert float(worst[2]) == pytest.approx(np.max(np.abs(motion.torque[joint] + body)), rel=0.06)
    assert float(worst[3]) == pytest.approx(made.limits.torque[joint], rel=0.01)


def test_a_fast_motion_is_noted(made):
    assert not any("Hz" in line for line in notes(made))
    fast = tuple(replace(each, basis=make_basis(1.0, 6)) for each in made.trajectories)
    assert any("reaches 6 Hz, where many arms oscillate" in line for line in notes(replace(made, trajectories=fast)))


def test_ros_2_reads_the_joint_trajectory(made, tmp_path):
    path = tmp_path / "new" / "trajectory.yaml"
    write_joint_trajectory(made.trajectories[0], path, rate=50.0)
    message = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert message["joint_names"] == ["joint1", "joint2"]
    assert set(message["header"]) == {"stamp", "frame_id"}
    points = message["points"]
    assert len(points) == 201
    time = np.array([p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"] for p in points])
    np.testing.assert_allclose(time, np.arange(201) / 50.0, atol=1e-9)
    q, v, a = made.trajectories[0].at(time)
    for kind, signal in (("positions", q), ("velocities", v), ("accelerations", a)):
        values = np.array([p[kind] for p in points])
        assert values.dtype == np.float64
        np.testing.assert_allclose(values.T, signal, rtol=1e-8, atol=1e-12)


def test_the_json_says_what_was_designed(made):
    content = json.loads(json.dumps(plain(excitation_dict(made)), allow_nan=False))
    assert content["log_det"] == pytest.approx(made.log_det)
    assert content["condition"] == pytest.approx(content["condition_of_regressor"] ** 2)
    # The same number wherever it is shown.
    said = f"J_k = cond H^T H {content['condition']:.4g}"
    assert content["summary"][-1].endswith(f"{said}.") and said in design_figures(made)[0]
    assert content["duration"] == 4.0 and content["harmonics"] == 6 and content["bandwidth_hz"] == pytest.approx(1.5)
    acceleration = content["limits"]["tool.acceleration"]
    assert acceleration["bound"] == 9.0 and acceleration["reached"] <= 9.0
    assert set(content["active_limits"]) <= set(content["limits"])
    assert [each["file"] for each in content["trajectories"]] == ["trajectory.csv", "trajectory-b.csv"]
    assert len(content["parameters"]) == 15
    assert content["search"]["seed"] == 0
    series = content["trajectories"][1]["joints"]["joint2"]
    phase = 2 * np.pi * np.arange(1, 7) / 4.0 * 2.5
    q = series["offset"][0] + series["cosine"] @ np.cos(phase) + series["sine"] @ np.sin(phase)
    assert q == pytest.approx(made.trajectories[1].at(np.array([2.5]))[0][1, 0], abs=1e-12)
    assert any("All limits hold" in line for line in content["summary"])
    assert any("the friction of the paper's Table 5 (OJD)" in line for line in content["notes"])


@pytest.mark.slow
def test_friction_that_is_known_counts_in_the_torque():
    model = build_model(load_robot())
    made = design_excitation(
        model,
        duration=4.0,
        harmonics=6,
        samples=400,
        known={"a01": 0.21, "a02": 0.09},
        criterion=Condition((0, 1, 3, 4)),
        effort=Effort(starts=1, rounds=0, processes=1),
    )
    torque = made.motion().torque
    bare = np.einsum("jpN,p->jN", model.regressor(made.trajectories[0].motion(4001))[:, :5], made.nominal[:5])
    moving = np.abs(made.motion().v[0]) > 1e-6
    np.testing.assert_allclose((np.abs(torque - bare)[0])[moving], 0.21, atol=1e-12)
    content = excitation_dict(made)
    assert content["criterion"] == {"name": "cond", "parameters": ["P_d1", "P_d2", "P_d4", "P_d5"]}
    assert any("with the friction given" in line for line in content["notes"])
