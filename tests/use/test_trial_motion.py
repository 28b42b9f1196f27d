"""The motion on which models are tried keeps every limit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.errors import RobotError
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import virtual_arm
from scara_ident.simulation.inverse_dynamics import inverse_dynamics
from scara_ident.use.trial_motion import trial_motion
from tests.arms import ur5


@pytest.mark.parametrize("name", [None, "ur5"])
def test_it_keeps_the_limits_and_is_its_own_derivative(name: str | None) -> None:
    arm = virtual_arm(load_robot(name))
    motion, robot = trial_motion(arm, 2), arm.robot
    assert np.all(motion.position.max(axis=1) <= robot.upper)
    assert np.all(motion.position.min(axis=1) >= robot.lower)
    assert np.all(np.abs(motion.velocity).max(axis=1) <= robot.velocity_limit)
    torque = inverse_dynamics(
        arm, arm.bodies, *(x[:, ::20] for x in (motion.position, motion.velocity, motion.acceleration))
    )
    assert np.all(np.abs(torque / arm.scale[:, None]).max(axis=1) <= robot.torque_limit)
    slope = np.gradient(motion.position, motion.time, axis=1)
    np.testing.assert_allclose(slope[:, 5:-5], motion.velocity[:, 5:-5], atol=2e-2 * np.abs(motion.velocity).max())


@pytest.mark.slow
def test_an_arm_that_cannot_hold_itself_is_refused() -> None:
    arm = virtual_arm(ur5())
    weak = replace(arm, robot=replace(arm.robot, effort_limit=np.full(6, 0.5)))
    with pytest.raises(RobotError, match="its weight alone exceeds the torque limits"):
        trial_motion(weak)


def test_a_range_from_nought_to_nought_is_none() -> None:
    """The arm stood still, no error of tracking was left."""
    arm = virtual_arm(load_robot())
    shut = replace(arm, robot=replace(arm.robot, lower=np.zeros(2), upper=np.zeros(2)))
    free = replace(arm, robot=replace(arm.robot, lower=np.full(2, -np.inf), upper=np.full(2, np.inf)))
    motion = trial_motion(shut, 1)
    np.testing.assert_array_equal(motion.position, trial_motion(free, 1).position)
    assert np.all(np.ptp(motion.position, axis=1) > 0.1)
