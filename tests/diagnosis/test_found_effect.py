"""The effects that came in, in that order."""

from __future__ import annotations

from scara_ident.diagnosis import diagnose
from scara_ident.effects import effects_named
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, virtual_runs


def test_errors_go_from_effect_to_effect() -> None:
    runs = virtual_runs("spring:joint1", "asymmetric_friction:joint2")
    found = diagnose(load_robot(), runs, bands=BANDS, catalogue=effects_named("spring", "asymmetric_friction")).effects
    assert {(item.effect, item.joint) for item in found} == {("spring", "joint1"), ("asymmetric_friction", "joint2")}
    first, second = found
    assert first.after == second.before
    assert all(item.after[item.joint] < item.before[item.joint] for item in found if item.joint)
    assert all(0.0 < item.gain <= 1.0 and item.p_value < 1e-2 for item in found)
