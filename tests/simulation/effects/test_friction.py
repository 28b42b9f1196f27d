"""Friction beyond a polynomial."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from scara_ident.simulation import (
    Effect,
    SimulationResult,
)
from scara_ident.simulation import effects as fx
from tests.simulation.effects.runs import Array, assert_changes_by, run
from tests.simulation.made import friction, left_over


def test_presliding_state_follows_dahls_equation() -> None:
    distance = 0.02
    result = run(fx.Presliding("joint1", distance), duration=4.0)
    true = result.true
    assert np.nanmax(np.abs(left_over(result.arm, true))) < 1e-10
    z = np.zeros_like(true.position[0])
    for k, way in enumerate(np.diff(true.position[0])):
        side = np.sign(way)
        z[k + 1] = side - (side - z[k]) * np.exp(-abs(way) / distance)
    assert np.ptp(z) > 1.9
    np.testing.assert_allclose(true.direction[0], z, atol=1e-4)


def test_smooth_friction_follows_the_speed_and_the_joint_never_sticks() -> None:
    result = run(fx.SmoothCoulomb("joint1", 0.05), duration=4.0)
    true = result.true
    assert np.nanmax(np.abs(left_over(result.arm, true))) < 1e-10
    np.testing.assert_allclose(true.direction[0], np.tanh(true.velocity[0] / 0.05), atol=1e-12)
    assert np.count_nonzero(np.abs(true.direction[0]) < 0.9) > 20


EQUATIONS: dict[Effect, Callable[[SimulationResult], Array]] = {
    fx.Stribeck("joint1", 0.1, 0.3): lambda r: 0.1 * r.true.direction[0] * np.exp(-((r.true.velocity[0] / 0.3) ** 2)),
    fx.AsymmetricFriction("joint2", 0.03): lambda r: 0.015 * abs(r.true.velocity[1]),
    fx.WarmUp("joint1", 0.4, 1.5): lambda r: (
        0.4 * np.exp(-r.recording.time / 1.5) * friction(r.arm, r.true.velocity, r.true.direction)[0]
    ),
    fx.PositionDependentFriction("joint2", 0.5, 0.3): lambda r: (
        0.5 * 0.088 * np.sin(r.true.position[1] + 0.3) * r.true.direction[1]
    ),
    fx.FrictionCoupling("joint1", 0.02, 0.03): lambda r: 0.02 * r.true.velocity[1] + 0.03 * r.true.direction[1],
}


@pytest.mark.parametrize("effect", EQUATIONS, ids=lambda effect: effect.name)
def test_torque_changes_by_the_equation(effect: Effect) -> None:
    assert_changes_by(effect, EQUATIONS[effect])
