"""The closed loop."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.errors import ScaraIdentError, UsageError
from scara_ident.simulation import simulate, virtual_arm
from scara_ident.simulation.loop import velocity_filter
from tests.simulation.made import nominal_torque, scara, swing


def test_closed_loop_reverses_without_chatter() -> None:
    arm = virtual_arm()
    motion = swing(arm.robot, 10.0)
    result = simulate(arm, motion)
    for wanted, done in zip(motion.velocity, result.true.velocity, strict=True):
        moving = done[done != 0.0]
        turns = np.count_nonzero(np.diff(np.sign(moving)))
        # Quantised feedback may make a joint stop and go on; it may not turn more often than the reference.
        assert turns <= np.count_nonzero(np.diff(np.sign(wanted[1:])))
    assert 0 < result.stops < 200
    assert np.abs(motion.position - result.true.position).max() < 0.02


def test_feed_forward_takes_most_of_the_error_away() -> None:
    arm = scara()
    motion = swing(arm.robot, 3.0)
    feed = nominal_torque(arm, motion) / arm.scale[:, None]
    errors = [np.abs(simulate(arm, motion, feed=x).true.position - motion.position).max() for x in (None, feed)]
    assert errors[1] < 0.2 * errors[0]
    with pytest.raises(UsageError, match=r"feed has shape \(2, 5\); expected \(2, 3001\)"):
        simulate(arm, motion, feed=feed[:, :5])


def test_a_lost_arm_is_one_line() -> None:
    arm = scara()
    wild = replace(arm, controller=replace(arm.controller, derivative=-1e9 * np.ones(2)))
    wild = replace(wild, robot=replace(arm.robot, effort_limit=np.full(2, np.inf)))
    with pytest.raises(ScaraIdentError, match="became unstable at"):
        simulate(wild, swing(arm.robot, 2.0))


def test_velocity_filter_is_critically_damped_at_its_cut_off() -> None:
    b0, b1, b2, a1, a2 = velocity_filter(1000.0, 100.0)
    for frequency in (0.0, 100.0, 250.0):
        z = np.exp(-2j * np.pi * frequency / 1000.0)
        response = (b0 + b1 * z + b2 * z * z) / (1.0 + a1 * z + a2 * z * z)
        warped = np.tan(np.pi * frequency / 1000.0) / np.tan(np.pi * 0.1)
        assert response == pytest.approx(1.0 / (1.0 + 1j * warped) ** 2, abs=1e-12)
