"""The torque that a motion takes is what the simulated drive gave."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.simulation import simulate
from scara_ident.simulation.inverse_dynamics import inverse_dynamics, nominal_torque, torque_at_start
from tests.simulation.made import scara, swing


def test_inverse_dynamics_give_back_the_torque_of_the_drive() -> None:
    arm = replace(scara(), torque_offset=np.array([0.03, -0.02]))
    arm = replace(arm, bodies=1.1 * arm.bodies)
    true = simulate(arm, swing(arm.robot, 2.0)).true
    torque = inverse_dynamics(arm, arm.bodies, true.position, true.velocity, true.acceleration)
    # Where a joint has just begun to move, friction has its direction already and its speed is still zero.
    moving = (true.direction != 0.0) & (true.velocity != 0.0)
    given = arm.scale[:, None] * true.effort
    np.testing.assert_allclose(torque[moving], given[moving], atol=1e-10 * np.abs(given).max())


def test_the_nominal_torque_is_of_the_urdfs_bodies_and_begins_as_the_arms_does_at_rest() -> None:
    arm = scara()
    motion = swing(arm.robot, 0.5)
    heavier = replace(arm, bodies=1.1 * arm.bodies)
    np.testing.assert_array_equal(nominal_torque(heavier, motion), nominal_torque(arm, motion))
    still = replace(motion, acceleration=0.0 * motion.acceleration)
    np.testing.assert_allclose(torque_at_start(arm, motion), nominal_torque(arm, still)[:, 0], atol=1e-12)
