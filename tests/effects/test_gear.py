"""Gear losses: the column against simulated arms of all kinds, and what no gear can have."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.effects import Member
from scara_ident.effects.gear import TransmissionLoss
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import effects as fx
from tests.effects.scenes import columns, scene_of
from tests.effects.simulated import ARMS, arm_of, run, true_motion, true_scene
from tests.simulation.made import left_over

SHARE = 0.2


@pytest.mark.parametrize("kind", ARMS)
def test_the_column_times_the_share_is_what_the_simulated_gear_loses(kind: str, tmp_path: Path):
    arm = arm_of(kind, tmp_path)
    result = run(arm, fx.TransmissionLoss(arm.robot.joints[0], SHARE))
    scene = replace(true_scene(result), armatures=dict(enumerate(arm.armature.tolist())))
    found = SHARE * columns(TransmissionLoss(), scene, true_motion(result), Member(0, (SHARE,)))[:, 0]
    lost = left_over(arm, result.true)
    seen = np.isfinite(lost) & np.all(result.true.velocity != 0.0, axis=0)
    assert np.count_nonzero(seen) > 0.9 * seen.size
    assert np.abs(found - lost)[seen].max() < 1e-8 * float(arm.torque_scale[0])
    assert np.abs(found[0]).max() > 1e-2 * float(arm.torque_scale[0])


def test_what_no_gear_can_have_is_refused():
    scene, member, std = scene_of(load_robot()), Member(1, (0.15,)), np.array([0.01])
    said = [TransmissionLoss().inadmissible(scene, member, np.array([x]), std) for x in (-0.1, 0.8, 0.1, 0.76)]
    assert said[:2] == [
        "a gear cannot give energy: the lost share is negative",
        "over three quarters of the torque would be lost",
    ]
    assert said[2:] == [None, None]


def test_the_rotors_share_of_an_inertia_matters_on_its_own_joint():
    assert TransmissionLoss().geared_joint(Member(1, (0.15,))) == 1
    assert {member.joint for member in TransmissionLoss().members(scene_of(load_robot()))} == {0, 1}
