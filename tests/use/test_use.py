"""What a result file's model wins."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.errors import ScaraIdentError, UsageError
from scara_ident.estimation.information import Information
from scara_ident.model.model import TorqueModel
from scara_ident.simulation import parse_effect, simulate, virtual_arm
from scara_ident.use import use
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


def test_a_joint_that_did_not_move_is_named() -> None:
    model = with_spring()
    moved = Information.empty(len(model.value)).absorb(np.ones((1, len(model.value))), np.ones(1))
    with pytest.raises(ScaraIdentError, match="joint2 did not move in the recordings"):
        use(replace(model, training=(moved, model.training[1])))


def test_a_model_that_the_virtual_arm_has_not_is_refused_in_one_line() -> None:
    model = with_spring()
    mine = TorqueModel("mine", model.robot, model.model.terms)
    with pytest.raises(UsageError, match="none that the virtual arm has"):
        use(replace(model, model=mine))
