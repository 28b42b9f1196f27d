"""Amplitude and phase of a sine and a cosine."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.effects import Member
from scara_ident.effects.periodic import TorqueRipple
from scara_ident.effects.signals import Signals
from scara_ident.effects.sinusoid import amplitude_and_phase, min_amplitude, sine_and_cosine, sines
from scara_ident.robot.robot import load_robot
from tests.effects.scenes import moving, scene_of


def test_amplitude_and_phase_have_the_deviations_of_a_sample():
    rng = np.random.default_rng(0)
    covariance = np.array([[4e-4, 1e-4], [1e-4, 2e-4]])
    draws = rng.multivariate_normal([0.3, -0.4], covariance, 20000)
    both = np.array([[part[0] for part in amplitude_and_phase(draw, covariance)] for draw in draws])
    (amplitude, spread), (phase, turn) = amplitude_and_phase(np.array([0.3, -0.4]), covariance)
    x = np.linspace(0.0, 6.0, 50)
    assert amplitude * np.sin(x + phase) == pytest.approx(0.3 * np.sin(x) - 0.4 * np.cos(x))
    assert [spread, turn] == pytest.approx(both.std(axis=0), rel=0.03)


def test_the_phase_of_nothing_is_anywhere_on_the_circle():
    amplitude, phase = amplitude_and_phase(np.zeros(2), 1e-4 * np.eye(2))
    assert amplitude == (0.0, pytest.approx(0.01))
    # The standard deviation of an angle of which nothing is known.
    assert phase[1] == pytest.approx(np.std(np.linspace(-np.pi, np.pi, 100_001)), rel=1e-4)


def test_both_coefficients_are_named_and_reported_in_the_unit_of_the_columns():
    assert [item.name for item in sine_and_cosine("a_{part}", "{part} of {joint}")] == ["a_sine", "a_cosine"]
    scene, member = scene_of(load_robot()), Member(0, (2.0,))
    sine, cosine = TorqueRipple().columns(scene, member)
    assert (sine.name, cosine.name) == ("ripple_sine", "ripple_cosine")
    assert sine.meaning == "sine of 2 times the motor's angle of joint1"
    found = TorqueRipple().parameters(scene, member, np.array([0.3, 0.4]), 1e-4 * np.eye(2))
    assert (found["amplitude"].value, found["amplitude"].unit) == (pytest.approx(0.5), "N m")


def test_an_amplitude_is_believed_two_deviations_smaller():
    assert min_amplitude(np.array([3.0, 4.0]), np.array([0.1, 0.2])) == pytest.approx(4.6)


@pytest.mark.parametrize("order", [0.5, 1.0, 2.5, 12.0])
def test_sines_of_whole_and_other_orders_are_those_of_the_angle(order: float):
    scene = scene_of(load_robot(), name="basic")
    motion = moving(scene.robot, duration=5.0)
    turns = scene.robot.reduction[1] * motion.q[1]
    found = sines(Signals(scene, motion), 1, order)
    # Rounding of an angle of some hundred rad.
    assert np.allclose(found, [np.sin(order * turns), np.cos(order * turns)], rtol=0.0, atol=1e-11)
