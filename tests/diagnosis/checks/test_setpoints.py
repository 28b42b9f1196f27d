"""Positions that no encoder gave: what is told by small ways of them is hedged, and not believed beside efforts in steps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.diagnosis.checks.setpoints import may_be_setpoints
from scara_ident.diagnosis.diagnose import Diagnosis, diagnose
from scara_ident.effects import CATALOGUE, Member, effects_named
from scara_ident.effects.elasticity import Backlash, JointElasticity
from scara_ident.effects.friction import Stribeck
from scara_ident.effects.presliding import Presliding, dahl_state
from scara_ident.motion.prepared import prepare
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from tests.arms import noisy, recorded_torque, recording, sines

ROBOT = load_robot()
COULOMB, DISTANCE = 0.1, 0.01
FRICTION = ((COULOMB, 0.05, 0.0, 0.0, 0.02), (0.04, 0.03, 0.0, 0.0, -0.01))
TIME = np.arange(2500) / 250.0


def run(seed: int, effort_step: float = 0.0, position_step: float = 0.0) -> Recording:
    """Friction of joint1 that turns round over a way of its positions, as that of what a controller is told does."""
    rng = np.random.default_rng(seed)
    q, v, a = sines(rng, TIME, 2, size=0.8, lowest=0.35)
    torque = recorded_torque(ROBOT, q, v, a, FRICTION)
    drive = ROBOT.drive_sign[0]
    torque[0] += COULOMB * drive * (dahl_state(q[0], DISTANCE) - np.sign(v[0]))
    item = noisy(recording(ROBOT, f"t{seed}_1", TIME, q, torque), rng, 2e-3)
    if effort_step:
        assert item.effort is not None
        item = replace(item, effort=effort_step * np.rint(item.effort / effort_step))
    return replace(item, position=position_step * np.rint(q / position_step)) if position_step else item


def diagnosed(**steps: float) -> Diagnosis:
    runs = [run(seed, **steps) for seed in range(4)]
    return diagnose(ROBOT, runs[:-1], validation=runs[-1:], bands=(12.0, 12.0), catalogue=effects_named("presliding"))


def test_beside_efforts_as_exact_it_is_found_with_what_else_it_may_be():
    (found,) = diagnosed().effects
    assert (found.effect, found.joint) == ("presliding", "joint1")
    assert "if they are setpoints, this is the lag of the controller" in found.description


def test_beside_efforts_in_steps_it_is_not_believed():
    result = diagnosed(effort_step=1e-3)
    assert result.effects == ()
    (open_,) = (item for item in result.tentative if item.joint == "joint1")
    assert "look like setpoints" in open_.why
    assert open_.why.endswith("log the measured positions")


def test_an_encoder_leaves_it_as_it_is():
    (found,) = diagnosed(effort_step=1e-3, position_step=1e-5).effects
    assert (found.effect, found.joint) == ("presliding", "joint1")
    assert "setpoints" not in found.description


def test_what_small_ways_tell_is_said_by_the_effects():
    data, member = prepare([run(0)]), Member(0, (DISTANCE,))
    assert may_be_setpoints(data, Presliding(), member)
    assert may_be_setpoints(data, JointElasticity(), member)
    assert may_be_setpoints(data, Backlash(), member)
    assert not may_be_setpoints(data, Stribeck(), member)
    assert not may_be_setpoints(prepare([run(0), run(1, position_step=1e-5)]), Presliding(), member)
    assert {effect.name for effect in CATALOGUE if effect.in_small_ways} == {
        "presliding",
        "joint_elasticity",
        "backlash",
    }
