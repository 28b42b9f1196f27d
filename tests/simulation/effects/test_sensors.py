"""Faults of the measurement."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.simulation import effects as fx
from tests.simulation.effects.runs import run
from tests.simulation.made import left_over


@pytest.mark.parametrize("ticks", [3, -2])
def test_delay_is_a_shift_of_effort(ticks: int) -> None:
    plain, late = run().recording.effort, run(fx.TimeDelay(delay=ticks * 1e-3)).recording.effort
    assert plain is not None
    assert late is not None
    shifted = np.roll(plain, ticks, axis=1)
    np.testing.assert_allclose(late[:, 5:-5], shifted[:, 5:-5], atol=1e-12)


def test_a_delay_by_half_a_sample_is_the_mean_of_neighbours_where_torque_is_straight() -> None:
    plain, late = run().recording.effort, run(fx.TimeDelay("joint2", 0.5e-3)).recording.effort
    assert plain is not None
    assert late is not None
    np.testing.assert_array_equal(plain[0], late[0])
    bend = np.abs(np.diff(plain[1], 2))[1:]
    wrong = np.abs(late[1, 2:-1] - 0.5 * (plain[1, 2:-1] + plain[1, 1:-2]))
    assert np.all(wrong <= np.maximum(bend, np.roll(bend, 1)) + 1e-12)


def test_sensor_effects_change_the_record_alone() -> None:
    plain = run()
    u, t = plain.recording.effort, plain.recording.time
    assert u is not None
    cases = {
        fx.TorqueSensorNonlinearity("joint1", 0.3): (0, u[0] + 0.3 * u[0] ** 3),
        fx.TorqueSensorNonlinearity("joint1", square=0.3): (0, u[0] + 0.3 * u[0] ** 2),
        fx.TorqueSensorNonlinearity("joint1", 0.2, 0.3): (0, u[0] + 0.3 * u[0] ** 2 + 0.2 * u[0] ** 3),
        fx.TorqueGainMismatch("joint2", 1.2): (1, 1.2 * u[1]),
        fx.OffsetDrift("joint1", 0.02): (0, u[0] + 0.02 * t),
        fx.TorqueRipple("joint2", 1.0, 0.03, 0.4, sensor=True): (
            1,
            u[1] + 0.03 * np.sin(100.0 * plain.true.position[1] + 0.4),
        ),
    }
    for effect, (j, expected) in cases.items():
        result = run(effect)
        assert result.recording.effort is not None
        np.testing.assert_array_equal(result.true.position, plain.true.position)
        np.testing.assert_allclose(result.recording.effort[j], expected, atol=1e-12)
        np.testing.assert_array_equal(result.recording.effort[1 - j], u[1 - j])


def test_encoder_eccentricity_is_in_the_measured_position() -> None:
    result = run(fx.EncoderEccentricity("joint1", 4e-5, 2.0, 0.3))
    q = result.true.position
    expected = 4e-5 * np.sin(200.0 * q[0] + 0.3)
    np.testing.assert_allclose(result.recording.position[0] - q[0], expected, atol=1e-15)
    np.testing.assert_array_equal(result.recording.position[1], q[1])
    assert np.nanmax(np.abs(left_over(result.arm, result.true))) < 1e-10
    assert np.abs(q - run().true.position).max() > 1e-6


@pytest.mark.parametrize("offset", [0.07, -1.5])
def test_a_joint_of_another_zero_moves_as_recorded_that_far_off(offset: float) -> None:
    plain, result = run(), run(fx.JointZero("joint2", offset))
    q = result.true.position
    np.testing.assert_allclose(result.recording.position[1], q[1] - offset, atol=1e-15)
    np.testing.assert_array_equal(result.recording.position[0], q[0])
    assert np.nanmax(np.abs(left_over(result.arm, result.true))) < 1e-10
    # It starts on the reference as any arm does, at the torque that this takes there.
    error = np.abs(result.recording.position - result.motion.position).max(axis=1)
    assert np.all(error < 3.0 * np.abs(plain.recording.position - plain.motion.position).max(axis=1))
    assert np.abs(result.true.effort - plain.true.effort).max() > 1e-3
