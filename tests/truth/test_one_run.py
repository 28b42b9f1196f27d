"""One recording only: what it shows is found, and what it cannot show is not called complete."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.diagnosis.diagnose import diagnose
from tests.arms import ur5
from tests.truth.scenes import Array, formula_run

pytestmark = pytest.mark.slow

WRISTS = ("wrist_2_joint", "wrist_3_joint")
VISCOUS, COULOMB = 1.5, 2.0


def test_coupled_wrists_are_found_in_one_noisy_run_of_45_s():
    """Commit a6cf3ca called it `complete`: with one degree of freedom left by 58 columns nothing was significant."""
    robot = ur5()
    places = [robot.joints.index(name) for name in WRISTS]

    def coupled(t: Array, q: Array, v: Array, a: Array, load: Array) -> Array:
        speed = np.sum(v[places], axis=0)
        torque = np.zeros_like(q)
        torque[places] = COULOMB * np.sign(speed) + VISCOUS * speed
        return torque

    run = formula_run(robot, "run", [7, 0], seconds=45.0, rate=100.0, bits=9, noise=0.1, added=coupled, highest=8)
    found = diagnose(robot, [run])
    assert found.verdict in ("undecided", "explained")
    assert {(item.effect, item.joint) for item in found.effects} == {("coupled_shaft", WRISTS[0])}
    for item in found.effects:
        for name, true in (("viscous", VISCOUS), ("coulomb", COULOMB)):
            value = item.parameters[name]
            assert abs(value.value - true) < 2.5 * value.std
