"""Spectra and autocorrelation of residuals."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.motion.motion import Motion
from scara_ident.report.spectra import autocorrelation, orders, spectrum
from scara_ident.robot.robot import load_robot
from tests.report.simulated import trace_of


def test_a_spectrum_holds_the_power_of_its_signal():
    """Parseval: the density integrates to the variance."""
    rate = 200.0
    signal = np.random.default_rng(1).standard_normal(int(400 * rate))
    found = spectrum([(signal, rate)])
    edges = np.gradient(found.frequency)
    assert np.sum(found.mean**2 * edges) == pytest.approx(1.0, rel=0.05)


def _trace(q: np.ndarray, torque: np.ndarray, rate: float = 500.0):
    zero = np.zeros_like(q)
    return trace_of(Motion("X", "X", np.arange(q.shape[1]) / rate, q, zero, zero, torque, rate))


def test_a_ripple_shows_at_its_order_with_its_amplitude_and_noise_stays_below_the_bound():
    robot = load_robot()
    time = np.arange(20000) / 500.0
    q = np.tile(0.8 * np.sin(2.0 * np.pi * 0.11 * time), (2, 1))
    noise = 0.02 * np.random.default_rng(2).standard_normal(q.shape)
    ripple = 0.05 * np.cos(4.0 * robot.reduction[0] * q[0] + 0.3)
    trace = _trace(q, noise)
    without = orders(robot, [trace], 0, [noise[0]])
    assert np.mean(without.amplitude > without.bound) < 0.002
    found = orders(robot, [trace], 0, [noise[0] + ripple])
    top = int(np.argmax(found.amplitude))
    assert found.order[top] == pytest.approx(4.0, abs=0.05)
    assert found.amplitude[top] == pytest.approx(0.05, rel=0.15)
    assert found.amplitude[top] > found.bound[top]


def test_white_residuals_stay_within_the_bounds_of_their_autocorrelation():
    torque = np.random.default_rng(3).standard_normal((2, 30000))
    found = autocorrelation([_trace(torque, torque)], 0)
    assert found.value[0] == pytest.approx(1.0)
    assert np.mean(np.abs(found.value[1:]) > found.bound) < 0.12
