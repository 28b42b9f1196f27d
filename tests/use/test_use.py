"""What a result file's model wins."""

from __future__ import annotations

from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
import pytest

from scara_ident.errors import LostArm, ScaraIdentError, UsageError
from scara_ident.estimation.information import Information
from scara_ident.model.model import TorqueModel
from scara_ident.motion.recorded_range import RecordedRange
from scara_ident.simulation import parse_effect, simulate, virtual_arm
from scara_ident.simulation.arm import VirtualArm
from scara_ident.use import tracking, use
from scara_ident.use.identified_arm import arms_of
from scara_ident.use.tracking import Tracked
from tests.simulation.made import swing
from tests.use.made import with_spring

pytestmark = pytest.mark.slow


def test_the_effect_wins_in_tracking_and_in_rollouts() -> None:
    arm = virtual_arm()
    spring = parse_effect("spring:joint1:stiffness=0.4,rest_position=0.1")
    motion = swing(arm.robot, 2.0)
    run = simulate(arm, motion, effects=[spring], seed=1).recording
    found = use(with_spring(), motion, [run])
    rms = found.rms()
    assert list(rms) == ["pid", "urdf", "identified", "effects"]
    assert rms["effects"][0] < 0.7 * rms["identified"][0]
    assert found.rollouts["effects"][-1, 0] < 0.5 * found.rollouts["identified"][-1, 0]


def test_an_arm_that_is_lost_is_drawn_nearer(monkeypatch: pytest.MonkeyPatch) -> None:
    """No controller held two arms of three drawn about a Panda whose model was held, and nothing was said of it but that."""
    tried: list[float] = []

    def fickle(arm: VirtualArm, *given: Any) -> tuple[Tracked, ...]:
        tried.append(float(arm.bodies[0, 9]))
        if len(tried) < 3:
            raise LostArm("lost")
        return tracking.tracked(arm, *given)

    monkeypatch.setattr(import_module("scara_ident.use.use"), "tracked", fickle)
    model = with_spring()
    slow = RecordedRange(np.zeros(2), np.zeros(2), np.array([1e-3, 9.0]), np.zeros(2))
    found = use(replace(model, found=(), reached=slow), swing(model.robot, 0.5), arms=1)
    assert [("joint1" in line, "joint2" in line) for line in found.notes if "faster than" in line] == [(True, False)]
    (arm, _), middle = found.drawn[0], float(arms_of(model)[1].bodies[0, 9])
    assert arm.bodies[0, 9] == tried[2]
    np.testing.assert_allclose(tried[2] - middle, [0.25 * (tried[0] - middle), 0.5 * (tried[1] - middle)], rtol=1e-6)

    def never(*_: Any) -> tuple[Tracked, ...]:
        raise LostArm("lost for good")

    monkeypatch.setattr(import_module("scara_ident.use.use"), "tracked", never)
    with pytest.raises(LostArm, match="for good"):
        use(replace(model, found=()), swing(model.robot, 0.5), arms=1)


def test_a_joint_that_did_not_move_is_named() -> None:
    model = with_spring()
    moved = Information.empty(len(model.value)).absorb(np.ones((1, len(model.value))), np.ones(1))
    with pytest.raises(ScaraIdentError, match="joint2 did not move in the recordings"):
        use(replace(model, training=(moved, model.training[1])))


def test_a_model_that_the_virtual_arm_has_not_is_refused_in_one_line() -> None:
    model = with_spring()
    mine = TorqueModel("mine", model.robot, model.model.terms)
    with pytest.raises(UsageError, match="the virtual arm does not have its model"):
        use(replace(model, model=mine))
