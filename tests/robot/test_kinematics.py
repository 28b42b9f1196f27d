"""How joints hang together, against Pinocchio's own words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from scara_ident.errors import RobotError
from scara_ident.robot.kinematics import (
    axis,
    constant_force,
    felt_directions,
    force_covariance,
    force_torques,
    leaning_torques,
    parent,
    place_of,
    tool_frame,
    tool_placement,
    weakest_direction,
)
from scara_ident.robot.robot import load_robot
from tests.arms import Link, example_urdf, write_urdf
from tests.simulation.made import tree


def test_every_joint_of_a_serial_arm_hangs_on_the_one_before_it():
    robot = load_robot(example_urdf("ur5_robot.urdf"))
    assert [parent(robot, j) for j in range(robot.n)] == [-1, 0, 1, 2, 3, 4]


def test_parents_of_a_branched_arm_are_those_of_its_urdf(tmp_path: Path):
    robot = tree(tmp_path)
    for j, name in enumerate(robot.joints):
        carrier = robot.model.parents[robot.model.getJointId(name)]
        assert parent(robot, j) == (robot.joints.index(robot.model.names[carrier]) if carrier else -1)
    assert place_of(robot, 0) == -1


def test_axes_are_those_about_which_a_unit_speed_turns():
    robot = load_robot(example_urdf("ur5_robot.urdf"))
    q = np.linspace(-1.0, 1.0, robot.model.nq)
    data = robot.model.createData()
    for j in range(robot.n):
        v = np.zeros(robot.model.nv)
        v[robot.order[j]] = 1.0
        pin.forwardKinematics(robot.model, data, q, v)
        joint_id = int(robot.order[j]) + 1
        assert axis(robot, data, j) == pytest.approx(data.oMi[joint_id].rotation @ data.v[joint_id].angular)


def test_the_tool_is_the_farthest_link_or_the_one_named():
    robot = load_robot()
    assert tool_frame(robot).placement.translation[0] == pytest.approx(0.33)
    assert tool_frame(robot, robot.links[0]).parentJoint == 1
    with pytest.raises(RobotError, match="no link 'hand'"):
        tool_frame(robot, "hand")


def test_positions_have_the_unit_of_their_joint(tmp_path: Path):
    robot = tree(tmp_path)
    assert [robot.position_unit(j) for j in range(robot.n)] == ["m" if slides else "rad" for slides in robot.prismatic]
    assert {"m", "rad"} == {robot.position_unit(j) for j in range(robot.n)}


def test_a_force_on_the_tool_is_found_from_what_it_is_at_the_joints():
    for robot in (load_robot(), load_robot(example_urdf("ur5_robot.urdf"))):
        force, rng = np.array([3.0, -2.0, 1.0]), np.random.default_rng(0)
        states = rng.uniform(-1.0, 1.0, (20, robot.model.nq))
        rows = list(force_torques(robot, states))
        # Against the power that the force has at the tool as the joints move.
        speed, data = rng.standard_normal(robot.n), robot.model.createData()
        turned = np.zeros(robot.n)
        turned[robot.order] = speed
        pin.forwardKinematics(robot.model, data, states[0], turned)
        frame = robot.model.getFrameId(tool_frame(robot).name)
        moved = pin.getFrameVelocity(robot.model, data, frame, pin.LOCAL_WORLD_ALIGNED).linear
        assert force @ moved == pytest.approx(speed @ (rows[0] @ force / robot.row_scale))
        found, share = constant_force(rows, [row @ force for row in rows])
        # Nothing tells what pushes across the plane of a planar arm.
        told = 3 if robot.n > 2 else 2
        np.testing.assert_allclose(found[:told], force[:told], atol=1e-9)
        assert share == pytest.approx(1.0)
    assert constant_force(rows, [np.zeros(6)] * 20)[1] == 0.0


def test_a_force_beside_the_tool_is_what_its_power_says():
    robot, rng = load_robot(example_urdf("ur5_robot.urdf")), np.random.default_rng(0)
    state, speed, force, beside = (rng.standard_normal(size) for size in (robot.model.nq, robot.n, 3, 3))
    turn, origin = tool_placement(robot)
    data, turned = robot.model.createData(), np.zeros(robot.n)
    turned[robot.order] = speed
    pin.forwardKinematics(robot.model, data, state, turned)
    link = robot.model.njoints - 1
    moved = pin.getVelocity(robot.model, data, link, pin.LOCAL_WORLD_ALIGNED)
    lever = data.oMi[link].rotation @ (origin + turn @ beside)
    power = force @ (moved.linear + np.cross(moved.angular, lever))
    (rows,) = leaning_torques(robot, [state])
    torque = rows @ np.append(1.0, beside) @ force
    assert torque @ (speed / robot.row_scale) == pytest.approx(power)


def test_the_covariance_of_a_force_is_that_of_forces_found_beside_errors():
    robot, rng = load_robot(example_urdf("ur5_robot.urdf")), np.random.default_rng(0)
    rows = list(force_torques(robot, rng.uniform(-1.0, 1.0, (5, robot.model.nq))))
    half = rng.standard_normal((6, 6))
    errors = [half @ rng.standard_normal(6) for _ in range(4000)]
    found = np.array([constant_force(rows, [error] * 5)[0] for error in errors])
    told = force_covariance(rows, half @ half.T)
    np.testing.assert_allclose(found.T @ found / len(found), told, atol=0.06 * np.max(np.diag(told)))
    # An axis that no row tells is as unsure as can be.
    flat = [row * [1.0, 1.0, 0.0] for row in rows]
    assert np.isnan(force_covariance(flat, half @ half.T)[2]).all()


def test_directions_that_an_arm_feels_and_what_it_feels_of_them_at_once():
    rng = np.random.default_rng(0)
    flat, arm = load_robot(), load_robot(example_urdf("ur5_robot.urdf"))
    assert felt_directions(flat, rng.uniform(-1.0, 1.0, (5, flat.model.nq))) == 2
    assert felt_directions(arm, rng.uniform(-1.0, 1.0, (5, arm.model.nq))) == 3
    bent, stretched = (list(force_torques(flat, [np.array([0.3, elbow])])) for elbow in (1.5, 1e-3))
    assert weakest_direction(bent, 2) > 0.2
    assert weakest_direction(stretched, 2) < 1e-3
    assert weakest_direction(bent, 3) == 0.0


def test_an_arm_whose_tool_is_on_its_only_axis_feels_no_force(tmp_path: Path):
    """It ended in a warning of NumPy, 0 over 0, on the terminal of ``contact``."""
    arm = load_robot(write_urdf(tmp_path / "wheel.urdf", [Link(axis=(0.0, 1.0, 0.0))]))
    rows = list(force_torques(arm, np.zeros((3, 1))))
    assert felt_directions(arm, np.zeros((3, 1))) == 0
    assert weakest_direction(rows, 0) == weakest_direction(rows, 1) == 0.0
