"""The torque that a motion takes is what the simulated drive gave."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.simulation import simulate
from scara_ident.simulation.inverse_dynamics import inverse_dynamics, torque_at_start
from tests.simulation.made import nominal_torque, scara, swing


def test_inverse_dynamics_give_back_the_torque_of_the_drive() -> None:
    arm = replace(scara(), torque_offset=np.array([0.03, -0.02]))
    arm = replace(arm, bodies=1.1 * arm.bodies)
    true = simulate(arm, swing(arm.robot, 2.0)).true
    torque = inverse_dynamics(arm, arm.bodies, true.position, true.velocity, true.acceleration)
    # Where a joint has just begun to move, friction has its direction already and its speed is still zero.
    moving = (true.direction != 0.0) & (true.velocity != 0.0)
    given = arm.scale[:, None] * true.effort
    np.testing.assert_allclose(torque[moving], given[moving], atol=1e-10 * np.abs(given).max())


def test_at_rest_it_begins_with_the_torque_that_holds_the_arm() -> None:
    arm = scara()
    motion = swing(arm.robot, 0.5)
    still = replace(motion, acceleration=0.0 * motion.acceleration)
    np.testing.assert_allclose(torque_at_start(arm, motion), nominal_torque(arm, still)[:, 0], atol=1e-12)
