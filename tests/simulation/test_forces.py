"""What holds a joint and what moves it."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from scara_ident.robot.robot import load_robot
from scara_ident.simulation import free_motion, ideal, simulate, virtual_arm
from tests.arms import Link, write_urdf
from tests.simulation.made import friction, left_over, scara, swing


def test_a_torque_below_breakaway_moves_nothing() -> None:
    arm = scara()
    torque = np.array([0.2, -0.08])
    _, true = free_motion(arm, [0.4, 0.9], [0.0, 0.0], 2.0, torque=torque)
    assert np.all(true.position == [[0.4], [0.9]])
    assert np.all(true.velocity == 0.0)
    np.testing.assert_array_equal(true.effort, np.repeat(torque[:, None], true.effort.shape[1], axis=1))


def test_a_torque_above_breakaway_moves_at_once() -> None:
    _, true = free_motion(scara(), [0.4, 0.9], [0.0, 0.0], 0.01, torque=np.array([0.215, 0.0]))
    assert np.all(true.velocity[0, 1:] > 0.0)
    assert np.all(true.velocity[1] == 0.0)


def test_a_reversing_gear_mirrors_the_motors_torque() -> None:
    arm = scara()
    other = replace(arm, robot=replace(arm.robot, reduction=np.array([-100.0, 100.0])))
    motion = swing(arm.robot, 2.0)
    one, mirrored = simulate(arm, motion).true, simulate(other, motion).true
    np.testing.assert_allclose(mirrored.effort, one.effort * [[-1.0], [1.0]], atol=1e-12)
    assert np.nanmax(np.abs(left_over(other, mirrored))) < 1e-10


def test_a_sliding_axis_runs(tmp_path: Path) -> None:
    robot = load_robot(write_urdf(tmp_path / "axis.urdf", [Link(kind="prismatic", mass=3.0)]))
    arm = ideal(virtual_arm(robot))
    result = simulate(arm, swing(robot, 3.0))
    true = result.true
    moving = true.direction[0] != 0.0
    force = (3.0 + arm.armature[0]) * true.acceleration[0] + 3.0 * 9.81
    force = force + friction(arm, true.velocity, true.direction)[0]
    np.testing.assert_allclose(true.effort[0, moving], force[moving], rtol=1e-10)
