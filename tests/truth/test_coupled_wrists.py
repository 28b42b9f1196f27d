"""A shaft that turns with two wrist joints is one effect, not the several that stand in for it."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.diagnosis.diagnose import diagnose
from tests.arms import ur5
from tests.truth.scenes import Array, formula_run

pytestmark = pytest.mark.slow

WRISTS = ["wrist_2_joint", "wrist_3_joint"]
SHAFT = {"inertia": 0.08, "viscous": 0.6, "coulomb": 0.7}


@pytest.mark.slow
def test_a_shaft_through_two_wrists_is_found_with_its_three_parameters():
    """Before there was such an effect two couplings of friction and one of inertia were named."""
    robot = ur5()
    places = [robot.joints.index(name) for name in WRISTS]
    side = -1.0
    arms = np.array([[1.0], [side]])

    def shaft(t: Array, q: Array, v: Array, a: Array, load: Array) -> Array:
        turn, speed_up = (np.sum(arms * part[places], axis=0) for part in (v, a))
        torque = np.zeros_like(q)
        torque[places] = arms * (
            SHAFT["inertia"] * speed_up + SHAFT["viscous"] * turn + SHAFT["coulomb"] * np.sign(turn)
        )
        return torque

    runs = [
        formula_run(robot, name, [11, k], seconds=12.0, rate=100.0, bits=18, added=shaft)
        for k, name in enumerate(("ma", "mb"))
    ]
    (effect,) = diagnose(robot, runs).effects
    assert (effect.effect, effect.joint) == ("coupled_shaft", WRISTS[0])
    assert ("difference" in effect.description) == (side < 0.0)
    for name, true in SHAFT.items():
        assert effect.parameters[name].value == pytest.approx(true, rel=0.05)
