"""Virtual arms of robots of which little is known."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.robot.robot import load_robot
from scara_ident.simulation import simulate, virtual_arm
from tests.arms import example_urdf
from tests.simulation.made import left_over, swing


@pytest.mark.parametrize("name", ["ur5_robot.urdf", "panda.urdf"])
def test_example_arms_follow_a_motion(name: str) -> None:
    arm = virtual_arm(load_robot(example_urdf(name)))
    motion = swing(arm.robot, 2.0, amplitude=0.2)
    result = simulate(arm, motion)
    assert np.abs(result.true.position - motion.position).max() < 0.03
    assert np.nanmax(np.abs(left_over(arm, result.true)) / arm.torque_scale[:, None]) < 1e-9
