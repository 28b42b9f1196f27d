"""Joints whose torque scale is wrong, the first among them: named, and the ratio is to the first joint's scale."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from scara_ident.diagnosis.diagnose import Diagnosis, diagnose
from scara_ident.effects import effects_named
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import Robot
from tests.arms import ur5
from tests.truth.scenes import formula_run

pytestmark = pytest.mark.slow


@cache
def exact_runs() -> tuple[Robot, tuple[Recording, ...]]:
    robot = ur5()
    runs = (formula_run(robot, f"run{k}", [31, k], seconds=12.0, rate=100.0, bits=18) for k in range(3))
    return robot, tuple(runs)


def found_with(*scale: float) -> Diagnosis:
    """Diagnose recordings with the efforts of the joints, in order, times a scale; those beyond stay."""
    robot, runs = exact_runs()
    factor = np.r_[scale, np.ones(robot.n - len(scale))][:, None]
    scaled = [replace(run, effort=factor * run.effort) for run in runs if run.effort is not None]
    return diagnose(robot, scaled, catalogue=effects_named("torque_gain_mismatch"))


def test_the_first_joint_is_named_where_it_differs_from_the_others():
    """Nothing was named, as the first joint was what all others were compared with."""
    (effect,) = found_with(1.25).effects
    assert (effect.effect, effect.joint) == ("torque_gain_mismatch", "shoulder_pan_joint")
    ratio = effect.parameters["ratio"]
    assert ratio.value == pytest.approx(1.25, abs=4.0 * ratio.std)
    assert ratio.std < 0.02
    assert "that of the joints not named" in effect.description


def test_the_ratio_is_to_the_first_joint_where_that_is_wrong_too():
    """The ratio of the second was 0.85, its scale over that of the joints that agree."""
    first, other = 1.12, 0.85
    effects = {effect.joint: effect for effect in found_with(first, 1.0, other).effects}
    assert set(effects) == {"shoulder_pan_joint", "elbow_joint"}
    ratio = effects["elbow_joint"].parameters["ratio"]
    assert ratio.value == pytest.approx(other / first, abs=4.0 * ratio.std)
    own = effects["shoulder_pan_joint"].parameters["ratio"]
    # It is as sure as the scales of both joints.
    assert ratio.std > 0.7 * own.std * other / first
    assert own.value == pytest.approx(first, abs=4.0 * own.std)


def test_of_joints_that_agree_none_is_named():
    assert found_with().effects == ()
