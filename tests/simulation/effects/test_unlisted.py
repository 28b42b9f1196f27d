"""The effects of no catalogue against their equations."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from scara_ident.simulation import (
    Effect,
    SimulationResult,
)
from scara_ident.simulation import effects as fx
from tests.simulation.effects.runs import Array, assert_changes_by

EQUATIONS: dict[Effect, Callable[[SimulationResult], Array]] = {
    fx.UnlistedSignedSine("joint1", 0.05): lambda r: 0.05 * np.sin(3.0 * r.true.position[1]) * r.true.direction[0],
    fx.UnlistedSwingingViscous("joint2", 0.04): lambda r: 0.04 * np.cos(2.0 * r.true.position[0]) * r.true.velocity[1],
}


@pytest.mark.parametrize("effect", EQUATIONS, ids=lambda effect: effect.name)
def test_torque_changes_by_the_equation(effect: Effect) -> None:
    assert_changes_by(effect, EQUATIONS[effect])
