"""The laws of filters that are late: moments of their impulse responses, their inverse, and what no filter can have."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.effects import Member
from scara_ident.effects.filters.filter_rest import LAWS
from scara_ident.effects.filters.position_filter import PositionFilter
from scara_ident.effects.filters.torque_filter import TorqueFilter
from scara_ident.robot.robot import load_robot
from tests.effects.scenes import scene_of


def test_moments_of_the_laws_are_those_of_their_impulse_responses():
    time = np.arange(0.0, 40.0, 1e-3)
    for name, response, variance, third in [
        ("first_order", np.exp(-time), 1.0, 2.0),
        ("second_order", 2.0 * np.exp(-time) * np.sin(time), 0.0, -1.0),
    ]:
        moment = [float(np.sum(response * (time - 1.0) ** k) * 1e-3) for k in range(4)]
        assert moment == pytest.approx([1.0, 0.0, variance, third], abs=2e-3)
        # The series of the transfer function without its delay.
        x = 0.05j
        assert np.exp(x) * LAWS[name](x) == pytest.approx(1.0 + x**2 * variance / 2.0 - x**3 * third / 6.0, abs=3e-6)


def test_the_inverse_of_a_filter_undoes_it():
    """Of a signal that is what it is before and after a window, to rounding."""
    time = np.arange(4000) / 500.0
    signal = np.exp(-0.5 * ((time - 4.0) / 0.3) ** 2)[None] * np.array([[1.0], [-2.0]])
    for law in range(2):
        seen = signal + TorqueFilter(0.01).rest(signal, 500.0)[law]
        assert np.max(np.abs(seen - signal)) > (1e-3, 1e-5)[law]
        assert seen + PositionFilter(0.01).rest(seen, 500.0, 60.0)[law] == pytest.approx(signal, abs=1e-8)


@pytest.mark.parametrize("effect", [TorqueFilter(0.02), PositionFilter(0.02)])
def test_a_negative_variance_is_no_filter(effect):
    scene, std = scene_of(load_robot()), np.array([0.1, 0.1])
    assert effect.inadmissible(scene, Member(None), np.array([0.9, 0.0]), std) is None
    why = effect.inadmissible(scene, Member(None), np.array([-0.9, 0.0]), std)
    assert why == "the impulse response of the filter would have a negative variance"
    # Zero width is known to no less than the root of what the share is unsure by.
    found = effect.parameters(scene, Member(None), np.array([0.0, 1.0]), np.diag(std**2))["width"]
    assert found.value == 0.0
    assert found.std == pytest.approx(0.02 * np.sqrt(0.1) / 2.0)
