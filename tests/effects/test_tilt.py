"""A tilted base: columns against Pinocchio under tilted gravity, recovery, and what tells it from a spring."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.effects import Member
from scara_ident.effects.tilt import BaseTilt, NominalBaseTilt
from scara_ident.model.model import build_model
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import PLANAR_2R, example_urdf, recorded_torque, recording, rnea, sines, write_urdf
from tests.effects.scenes import columns, fit, moving, scene_of
from tests.simulation.made import tree

TILT = (0.03, -0.02)


def leaning(robot: Robot, tilt: tuple[float, float]) -> Robot:
    model = robot.model.copy()
    g = np.linalg.norm(model.gravity.linear)
    model.gravity.linear = model.gravity.linear - g * np.array([*tilt, 0.0])
    return replace(robot, model=model)


def arm(name: str, folder: Path) -> Robot:
    if name == "scara03":
        return load_robot()
    if name == "ur5":
        return load_robot(example_urdf("ur5_robot.urdf"))
    return tree(folder) if name == "tree" else load_robot(write_urdf(folder / "planar.urdf", PLANAR_2R))


@pytest.mark.parametrize("name", ["scara03", "ur5", "tree", "planar"])
def test_the_columns_are_what_tilted_gravity_adds(name: str, tmp_path: Path):
    robot = arm(name, tmp_path)
    item = moving(robot, 1.0)
    state = (item.q, item.v, item.a)
    added = rnea(leaning(robot, TILT), *state) - rnea(robot, *state)
    added *= robot.row_scale[:, None]
    scene = scene_of(robot)
    size = np.abs(added).max()
    free = columns(BaseTilt(), scene, item, Member(None))
    names = [column.name for column in BaseTilt().columns(scene, Member(None))]
    flat = free.transpose(0, 2, 1).reshape(-1, free.shape[1])
    value, *_ = np.linalg.lstsq(flat, added.ravel(), rcond=1e-10)
    assert np.abs(flat @ value - added.ravel()).max() < 1e-6 * size
    for axis, tilt in zip("xy", TILT, strict=True):
        if f"tilt_{axis}" in names:
            assert value[names.index(f"tilt_{axis}")] == pytest.approx(tilt, rel=1e-4)
    for member in NominalBaseTilt().members(scene)[2:3]:
        assert member.nonlinear == pytest.approx([1.0])
        nominal = columns(NominalBaseTilt(), scene, item, member)
        assert np.abs(np.einsum("jkn,k->jn", nominal, np.array(TILT)) - added).max() < 1e-6 * size


def test_on_a_wall_it_turns_gravity_towards_the_bases_z():
    """The base's x and y alone left out one direction, and made the size of gravity of the other."""
    upright = load_robot(example_urdf("ur5_robot.urdf"))
    hung, turned = (upright.model.copy() for _ in range(2))
    hung.gravity.linear = np.array([0.0, -9.81, 0.0])
    turned.gravity.linear = 9.81 * np.array([0.0, -np.cos(0.02), -np.sin(0.02)])
    robot = replace(upright, model=hung)
    item, scene = moving(robot, 1.0), scene_of(robot)
    described = BaseTilt().columns(scene, Member(None))
    assert [column.name for column in described][:2] == ["tilt_x", "tilt_z"]
    assert described[1].meaning == "gravity along the base's z is -g times this"
    state = (item.q, item.v, item.a)
    added = (rnea(replace(upright, model=turned), *state) - rnea(robot, *state)) * robot.row_scale[:, None]
    free = columns(BaseTilt(), scene, item, Member(None))
    value, *_ = np.linalg.lstsq(free.transpose(0, 2, 1).reshape(-1, free.shape[1]), added.ravel(), rcond=1e-10)
    assert value[:2] == pytest.approx([0.0, 0.02], abs=3e-4)


def test_level_vertical_axes_leave_two_moments_of_the_first_link_unknown():
    scene = scene_of(load_robot())
    names = [column.name for column in BaseTilt().columns(scene, Member(None))]
    assert names == ["tilt_x", "tilt_y", "tilt_moment1", "tilt_moment2"]
    # m1 x1 + m2 l1 and m1 y1 of the URDF.
    robot = scene.robot
    standard = robot.standard_parameters()
    entering = columns(BaseTilt(), scene, moving(robot, 0.2), Member(None))[:, 2:]
    nominal = columns(NominalBaseTilt(), scene, moving(robot, 0.2), Member(None, (1.0,)))
    known = columns(BaseTilt(), scene, moving(robot, 0.2), Member(None))[:, :2]
    moment = standard[1] + 0.33 * standard[10]
    assert nominal[:, 0] - known[:, 0] == pytest.approx(moment * entering[:, 0])
    assert nominal[:, 1] - known[:, 1] == pytest.approx(-moment * entering[:, 1])


def test_an_axis_along_which_gravity_does_nothing_is_left_out(tmp_path: Path):
    # Joint axes along y: gravity along y never turns them.
    scene = scene_of(load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R)))
    assert [column.name for column in BaseTilt().columns(scene, Member(None))] == ["tilt_x"]
    assert NominalBaseTilt().members(scene) == ()


@pytest.mark.parametrize(("effect", "member"), [(BaseTilt(), Member(None)), (NominalBaseTilt(), Member(None, (1.0,)))])
def test_the_tilt_is_recovered_from_noisy_torque(effect, member):
    robot = load_robot()
    rng = np.random.default_rng(4)
    time = np.arange(8000) / 500.0
    recordings = []
    for k in range(2):
        q, v, a = sines(rng, time, 2, size=0.9, lowest=0.3)
        u = recorded_torque(leaning(robot, TILT), q, v, a, [(0.1, 0.05, 0.0, 0.0, 0.02)] * 2)
        recordings.append(recording(robot, f"t{k}_1", time, q, u + 0.02 * rng.standard_normal(u.shape)))
    scene, value, covariance = fit(build_model(robot), recordings, effect, member, rounds=1)
    found = effect.parameters(scene, member, value, covariance)
    for axis, tilt in zip("xy", TILT, strict=True):
        item = found[f"tilt_{axis}"]
        assert item.value == pytest.approx(tilt, abs=3.5 * item.std)
        assert item.std < 0.004
        assert item.unit == "rad"
    assert effect.inadmissible(scene, member, value, np.sqrt(np.diag(covariance))) is None


def test_all_columns_together_tell_the_tilt_better_than_the_known_part_alone():
    scene = scene_of(load_robot())
    moment = 7.065
    value = np.array([0.02, -0.01, 0.02 * moment, 0.01 * moment])
    covariance = np.diag([0.004, 0.004, 0.002 * moment, 0.002 * moment]) ** 2
    item = BaseTilt().parameters(scene, Member(None), value, covariance)
    assert item["tilt_x"].value == pytest.approx(0.02)
    # The direction comes from four coefficients, the size from the known two.
    assert item["tilt_y"].std < 0.003
    # Moments that point elsewhere are not believed.
    turned = np.array([0.02, -0.01, -0.01 * moment, 0.02 * moment])
    item = BaseTilt().parameters(scene, Member(None), turned, covariance / 25.0)
    assert item["tilt_x"].value == 0.02
    assert item["tilt_x"].std == pytest.approx(0.004 / 5.0)


def test_what_only_the_first_joint_shows_is_no_tilt():
    scene = scene_of(load_robot())
    std = np.array([0.002, 0.002, 0.01, 0.01])
    spring_like = np.array([0.001, -0.002, 0.3, 0.4])
    assert "spring" in str(BaseTilt().inadmissible(scene, Member(None), spring_like, std))
    assert BaseTilt().inadmissible(scene, Member(None), np.array([0.02, 0.0, 0.14, 0.0]), std) is None
    assert "tilted by" in str(BaseTilt().inadmissible(scene, Member(None), np.array([0.2, 0.0, 1.4, 0.0]), std))
    assert "tilted by" in str(
        NominalBaseTilt().inadmissible(scene, Member(None, (1.0,)), np.array([0.2, 0.0]), std[:2])
    )
