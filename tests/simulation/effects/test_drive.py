"""Ripple, spring and vibration against their equations."""

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
    fx.TorqueRipple("joint1", 3.0, 0.04, 0.6): lambda r: 0.04 * np.sin(300.0 * r.true.position[0] + 0.6),
    fx.Spring("joint2", 0.05, 0.2): lambda r: 0.05 * (r.true.position[1] - 0.2),
    fx.Vibration("joint1", 7.0, 0.03, 0.1): lambda r: 0.03 * np.sin(2 * np.pi * 7.0 * r.recording.time + 0.1),
}


@pytest.mark.parametrize("effect", EQUATIONS, ids=lambda effect: effect.name)
def test_torque_changes_by_the_equation(effect: Effect) -> None:
    assert_changes_by(effect, EQUATIONS[effect])
