"""The rigid-body term against Pinocchio's inverse dynamics, gears and rotors included."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from scara_ident.arrays import Array
from scara_ident.model.regressor.kernel import configurations
from scara_ident.model.terms.rigid_body import rigid_body
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import PLANAR_2R, Link, example_urdf, motion, recorded_torque, write_urdf

TREE = (
    Link(axis=(0, 0, 1)),
    Link(axis=(0, 1, 0), xyz=(0.3, 0, 0.1), kind="prismatic"),
    Link(axis=(1, 0, 0), xyz=(0, 0.2, 0), rpy=(0.3, 0.2, 0.1), kind="continuous", parent=0),
    Link(axis=(0, 0.6, 0.8), xyz=(0.1, 0, 0)),
)


def described(folder: Path, text: str) -> Robot:
    write_urdf(folder / "arm.urdf", TREE)
    path = folder / "robot.yaml"
    path.write_text(f"urdf: arm.urdf\n{text}", encoding="utf-8")
    return load_robot(path)


def assert_inverse_dynamics(robot: Robot, samples: int = 30) -> None:
    """Last joints move like the first: no acceleration lost, no body off by one, no row in the wrong place."""
    rng = np.random.default_rng(0)
    q, v, a = (rng.uniform(-1.5, 1.5, (robot.n, samples)) for _ in range(3))
    term = rigid_body(robot)
    value = (term.base.grouping @ robot.standard_parameters())[term.kept]
    found = np.einsum("jpk,p->jk", term.regressor(motion(q, v, a)), value)
    expected = recorded_torque(robot, q, v, a, ())
    allowed = 1e-12 * np.max(np.abs(expected)) * robot.n
    np.testing.assert_allclose(found, expected, rtol=0, atol=allowed)
    np.testing.assert_allclose(term.torque(motion(q, v, a), value), expected, rtol=0, atol=allowed)
    assert_slopes(robot, value, q, v, a)
    pattern = np.any(term.regressor(motion(q, v, a)) != 0.0, axis=2)
    assert not np.any(pattern & ~term.pattern)


def assert_slopes(robot: Robot, value: Array, q: Array, v: Array, a: Array) -> None:
    """Derivatives are those of Pinocchio, of bodies with rotors at their joints."""
    term, model, order = rigid_body(robot), robot.model, robot.order
    data, armature = model.createData(), robot.standard_parameters()[10 * robot.n :]
    found = [term.slopes(motion(q, v, a), value, joint) for joint in range(robot.n)]
    back = np.argsort(order)
    for k in range(q.shape[1]):
        full = configurations(model, q[back, k : k + 1])[:, 0]
        pin.computeRNEADerivatives(model, data, full, v[back, k], a[back, k])
        inertia = np.triu(data.M) + np.triu(data.M, 1).T
        for part, whole in enumerate((data.dtau_dq, data.dtau_dv, inertia)):
            expected = whole[np.ix_(order, order)] + np.diag(armature * (part == 2))
            expected = robot.row_scale[:, None] * expected
            for joint in range(robot.n):
                allowed = 1e-11 * max(1.0, np.max(np.abs(expected)))
                np.testing.assert_allclose(found[joint][part, :, k], expected[:, joint], rtol=0, atol=allowed)


def test_it_is_inverse_dynamics_on_the_scara03():
    assert_inverse_dynamics(load_robot())


@pytest.mark.parametrize("urdf", ["ur5_robot.urdf", "double_pendulum_continuous.urdf", "finger_edu.urdf"])
def test_it_is_inverse_dynamics_on_arms_of_example_robot_data(urdf: str):
    assert_inverse_dynamics(load_robot(example_urdf(urdf)))


@pytest.mark.parametrize("side", ["motor", "joint"])
@pytest.mark.parametrize("order", [(1, 2, 3, 4), (3, 1, 4, 2)])
def test_it_is_inverse_dynamics_on_a_branched_arm_with_gears(tmp_path: Path, side: str, order: tuple[int, ...]):
    gears = {1: (100, 1e-4), 2: (-250.0, 2e-4), 3: (-80, 3e-4), 4: (1, 0.02)}
    joints = ", ".join(f"j{k}: {{reduction: {gears[k][0]}, rotor_inertia: {gears[k][1]}}}" for k in order)
    assert_inverse_dynamics(described(tmp_path, f"effort_side: {side}\njoints: {{{joints}}}\n"))


def test_the_scara03_carries_the_papers_names():
    term = rigid_body(load_robot())
    assert [column.name for column in term.columns] == ["P_d1", "P_d2", "P_d3", "P_d4", "P_d5"]
    assert term.columns[0].meaning == "I1z + m2 l1^2 + Jm1/tau1^2"
    assert [column.nonnegative for column in term.columns] == [True, False, False, True, True]
    assert [column.joint for column in term.columns] == ["joint1", "joint2", "joint2", "joint2", "joint2"]


def test_other_arms_carry_what_the_parameters_are_made_of(tmp_path: Path):
    term = rigid_body(load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R)))
    assert [column.name for column in term.columns] == list(term.base.names)
    assert "I1yy + 0.16 m2 + Jm1" in [column.meaning for column in term.columns]


def test_a_column_left_out_leaves_the_others_as_they_are():
    robot = load_robot()
    rng = np.random.default_rng(1)
    moved = motion(*(rng.standard_normal((2, 10)) for _ in range(3)))
    full, less = rigid_body(robot), rigid_body(robot, without=("P_d3",))
    assert [column.name for column in less.columns] == ["P_d1", "P_d2", "P_d4", "P_d5"]
    np.testing.assert_array_equal(less.regressor(moved), full.regressor(moved)[:, [0, 1, 3, 4]])


def test_what_cannot_be_negative_is_not_in_any_real_arm(tmp_path: Path):
    """Base parameters of random bodies, each a cloud of positive points: none marked may come out negative."""
    term = rigid_body(load_robot(write_urdf(tmp_path / "arm.urdf", TREE)))
    rng = np.random.default_rng(2)
    for _ in range(200):
        bodies = []
        for _ in range(4):
            mass, points = rng.exponential(1.0, 3), rng.standard_normal((3, 3)) * rng.exponential(1.0)
            inertia = sum(m * (x @ x * np.eye(3) - np.outer(x, x)) for m, x in zip(mass, points, strict=True))
            bodies += [mass.sum(), *(mass @ points), inertia[0, 0], inertia[0, 1], inertia[1, 1], *inertia[2]]
        value = term.base.grouping @ np.array([*bodies, *rng.exponential(1.0, 4)])
        marked = [k for k, column in enumerate(term.columns) if column.nonnegative]
        assert marked
        assert np.all(value[marked] >= 0.0)


def test_the_motor_side_is_the_joint_side_over_the_reduction():
    robot = load_robot()
    rng = np.random.default_rng(3)
    moved = motion(*(rng.standard_normal((2, 10)) for _ in range(3)))
    motor = rigid_body(robot).regressor(moved)
    joint = rigid_body(replace(robot, effort_side="joint")).regressor(moved)
    np.testing.assert_allclose(100.0 * motor, joint, rtol=1e-12)
