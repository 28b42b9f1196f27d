"""The arm on either side of its gears."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.simulation import on_side, simulate
from scara_ident.simulation.effects import TransmissionLoss
from tests.simulation.made import scara, swing


def test_the_same_arm_gives_joint_torque_n_times_the_motors() -> None:
    motor = scara()
    joint = on_side(motor, "joint")
    effect = TransmissionLoss(joint="joint2", loss_coefficient=0.2)
    motion = swing(motor.robot, 2.0)
    one, other = (simulate(arm, motion, effects=[effect]) for arm in (motor, joint))
    np.testing.assert_allclose(other.true.effort, 100.0 * one.true.effort, rtol=1e-9, atol=1e-7)
    np.testing.assert_allclose(other.true.position, one.true.position, atol=1e-10)
    assert on_side(joint, "motor").friction == pytest.approx(motor.friction)
