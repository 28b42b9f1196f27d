"""What a result file's model wins."""

from __future__ import annotations

import pytest

from scara_ident.errors import UsageError
from scara_ident.simulation import parse_effect, simulate, virtual_arm
from scara_ident.use import use, used_model
from tests.simulation.made import swing
from tests.use.made import content

pytestmark = pytest.mark.slow


def test_the_effect_wins_in_tracking_and_in_rollouts() -> None:
    arm = virtual_arm()
    spring = parse_effect("spring:joint1:stiffness=0.4,rest_position=0.1")
    motion = swing(arm.robot, 2.0)
    run = simulate(arm, motion, effects=[spring], seed=1).recording
    found = use(used_model(content(), arm.robot), motion, [run])
    rms = found.rms()
    assert list(rms) == ["pid", "urdf", "identified", "effects"]
    assert rms["effects"][0] < 0.7 * rms["identified"][0]
    assert found.rollouts["effects"][-1, 0] < 0.5 * found.rollouts["identified"][-1, 0]


def test_what_is_no_result_is_refused_in_one_line() -> None:
    arm = virtual_arm()
    with pytest.raises(UsageError, match=r"identified for panda, the robot given is scara03"):
        used_model(content() | {"robot": "panda"}, arm.robot)
    with pytest.raises(UsageError, match="none that the virtual arm has"):
        used_model(content() | {"model": "mine"}, arm.robot)
    with pytest.raises(UsageError, match="no parameters are in it"):
        used_model({"robot": "scara03"}, arm.robot)
