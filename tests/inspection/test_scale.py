"""The scale of effort as inspect tells it from the URDF's masses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from scara_ident.inspection.inspection import inspect_file
from scara_ident.robot.robot import load_robot
from tests.arms import PLANAR_2R, Link, write_urdf
from tests.made_recordings import save
from tests.shared import shared_path

FRICTION = (0.5, 0.2)


def recorded(urdf: Path, folder: Path, gains: tuple[float, float], rotor: float = 0.0) -> Path:
    """Twenty seconds of sines at 200 Hz, torque with friction, noise and a first rotor, written down as torque over gain."""
    model = load_robot(urdf).model
    time = np.arange(4000) / 200.0
    q, v, a = np.zeros((3, 2, 4000))
    for j, frequency in enumerate((0.23, 0.37)):
        w = 2.0 * np.pi * frequency
        q[j], v[j], a[j] = np.sin(w * time), w * np.cos(w * time), -(w**2) * np.sin(w * time)
    data = model.createData()
    torque = np.array([pin.rnea(model, data, *state) for state in zip(q.T, v.T, a.T, strict=True)]).T
    torque[0] += rotor * a[0]
    torque += 0.05 * np.random.default_rng(1).standard_normal(torque.shape)
    made = {"time": time}
    for j in range(2):
        made[f"j{j + 1}.position"] = q[j]
        made[f"j{j + 1}.effort"] = (torque[j] + FRICTION[j] * np.sign(v[j])) / gains[j]
    return save(folder / "run_1.parquet", made)


def scale(notes: tuple[str, ...]) -> list[str]:
    return [note for note in notes if "by the URDF's masses" in note]


def test_currents_on_an_arm_that_carries_its_weight_have_a_scale(tmp_path: Path):
    urdf = write_urdf(tmp_path / "arm.urdf", PLANAR_2R)
    found = inspect_file(recorded(urdf, tmp_path, (12.0, 0.25)), urdf=urdf)
    (said,) = scale(found.notes)
    assert "12 N m on j1, 0.25 N m on j2" in said
    # What is read once on a terminal stands in the file that is to be mended, too.
    assert f"# note: {said}" in (found.description or "").splitlines()


def test_an_opposite_sign_is_reported(tmp_path: Path):
    urdf = write_urdf(tmp_path / "arm.urdf", PLANAR_2R)
    (said,) = scale(inspect_file(recorded(urdf, tmp_path, (1.0, -1.0)), urdf=urdf).notes)
    assert said.endswith("roughly -1 N m on j2: is effort_gain to be stated, negative where the sign is opposite?")


def test_where_most_joints_agree_the_masses_are_doubted_as_well(tmp_path: Path):
    """A UR10's wrist was said to be recorded in units of 0.087 N m beside two joints in N m: its URDF has the wrist's mass on the axis."""
    urdf = write_urdf(tmp_path / "arm.urdf", PLANAR_2R)
    (said,) = scale(inspect_file(recorded(urdf, tmp_path, (1.0, 0.2)), urdf=urdf).notes)
    assert said.endswith(
        "roughly 0.2 N m on j2, and near 1 on j1: is effort_gain to be stated, or do the masses there differ?"
    )


def test_large_scales_of_all_joints_may_be_a_gear(tmp_path: Path):
    """Motor torques of an arm without reductions in its URDF: 110, 81, 78, 26 and 25 N m were asked for as `effort_gain`."""
    urdf = write_urdf(tmp_path / "arm.urdf", PLANAR_2R)
    (said,) = scale(inspect_file(recorded(urdf, tmp_path, (110.0, 50.0)), urdf=urdf).notes)
    assert said.endswith("or is it measured in front of a gear (effort_side: motor, reduction)?")
    (current,) = scale(inspect_file(recorded(urdf, tmp_path, (110.0, 5.0)), urdf=urdf).notes)
    assert current.endswith("is effort_gain to be stated?")


def test_torques_are_not_remarked_on(tmp_path: Path):
    urdf = write_urdf(tmp_path / "arm.urdf", PLANAR_2R)
    assert scale(inspect_file(recorded(urdf, tmp_path, (1.0, 1.0)), urdf=urdf).notes) == []


def test_what_noise_drowns_is_not_determined(tmp_path: Path):
    light = [Link(axis=(0.0, 1.0, 0.0), mass=1e-3, com=(0.1, 0.0, 0.0), inertia=(1e-5, 1e-5, 1e-5))] * 2
    urdf = write_urdf(tmp_path / "arm.urdf", light)
    assert scale(inspect_file(recorded(urdf, tmp_path, (12.0, 12.0)), urdf=urdf).notes) == []


def test_behind_a_gear_the_side_comes_first(tmp_path: Path):
    urdf = write_urdf(tmp_path / "arm.urdf", PLANAR_2R, reductions=(100.0, 100.0))
    assert scale(inspect_file(recorded(urdf, tmp_path, (12.0, 12.0)), urdf=urdf).notes) == []


def test_the_ur10es_currents_are_determined_within_a_third_of_the_published_gains():
    place = shared_path("data", "ur10e")
    (said,) = scale(inspect_file(place / "ident_50s_12harm.parquet", urdf=place / "ur10e.urdf").notes)
    for joint, published in (("shoulder_lift_joint", 13.26), ("elbow_joint", 11.13), ("wrist_1_joint", 10.62)):
        told = float(said.partition(f" N m on {joint}")[0].split()[-1])
        assert told == pytest.approx(published, rel=1 / 3)
    assert "shoulder_pan_joint" not in said


def test_a_rotor_that_no_urdf_states_is_not_taken_for_torque_of_the_links(tmp_path: Path):
    # Its inertia is half of the links', so that an upright axis asks for half as much again.
    upright = [Link(axis=(0.0, 0.0, 1.0), mass=2.0, com=(0.2, 0.0, 0.0), inertia=(0.01, 0.01, 0.02))]
    urdf = write_urdf(tmp_path / "arm.urdf", [*upright, PLANAR_2R[1]])
    (said,) = scale(inspect_file(recorded(urdf, tmp_path, (12.0, 0.25), rotor=0.1), urdf=urdf).notes)
    assert "12 N m on j1, 0.25 N m on j2" in said
