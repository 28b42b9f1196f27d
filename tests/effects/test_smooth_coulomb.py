"""Coulomb friction that builds up with speed: columns against simulated arms, limits, recovery from another law's torque."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.diagnosis import diagnose
from scara_ident.effects import Member
from scara_ident.effects.smooth_coulomb import SPEED_SHARES, SmoothCoulomb
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import effects as fx
from tests.arms import Link, noisy, recorded_torque, recording, sines, write_urdf
from tests.effects.scenes import columns, scene_of
from tests.effects.simulated import ARMS, arm_of, run, true_motion, true_scene

RATE, SECONDS = 250.0, 20.0


@pytest.mark.parametrize("kind", ARMS)
def test_the_column_is_what_the_simulated_arm_adds(kind: str, tmp_path: Path) -> None:
    arm = arm_of(kind, tmp_path)
    velocity = 0.05 * float(arm.radian[0])
    result = run(arm, fx.SmoothCoulomb(arm.robot.joints[0], velocity), 3.0)
    a0 = arm.friction[0, 0]
    scene, item = true_scene(result), true_motion(result)
    member = Member(0, (velocity,))
    column = columns(SmoothCoulomb(), scene, item, member)[0, 0]
    side = arm.robot.drive_sign[0]
    added = side * (result.true.direction[0] - np.sign(result.true.velocity[0]))
    np.testing.assert_allclose(column, added, atol=1e-9)
    assert np.abs(added).max() > 0.5
    few = np.array([0.01 * a0])
    assert SmoothCoulomb().inadmissible(scene, member, np.array([a0]), few) is None
    for size in (2.0, 0.1, -1.0):
        assert SmoothCoulomb().inadmissible(scene, member, np.array([size * a0]), few), size
    wide = Member(0, (0.6 * float(scene.speed[0]),))
    assert "never moves much faster" in str(SmoothCoulomb().inadmissible(scene, wide, np.array([a0]), few))


@pytest.mark.parametrize("speed", [0.02, 2.0, 200.0])
def test_speeds_of_a_slide_are_shares_of_its_largest_whatever_a_metre_is(tmp_path: Path, speed: float) -> None:
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", [Link("prismatic")]))
    scene = replace(scene_of(robot), speed=np.array([speed]))
    tried = [member.nonlinear[0] for member in SmoothCoulomb().members(scene)]
    assert tried == pytest.approx([share * speed for share in SPEED_SHARES])
    ((lower, upper),) = SmoothCoulomb().limits(scene, Member(0, (tried[0],)))
    assert lower < min(tried) and max(tried) < upper


def recorded(velocity: float) -> list[Recording]:
    """Three motions, twice each, of a SCARA03 whose second joint's friction is ``0.03 tanh(v/velocity)`` by closed form."""
    robot, time, random = load_robot(), np.arange(round(SECONDS * RATE)) / RATE, np.random.default_rng(0)
    found = []
    for k in range(3):
        q, v, a = sines(np.random.default_rng(k), time, robot.n)
        torque = recorded_torque(robot, q, v, a, [(0.1, 0.05, 0.0, 0.0, 0.0), (0.0, 0.01, 0.0, 0.0, 0.0)])
        torque[1] += 0.03 * np.tanh(robot.drive_sign[1] * v[1] / velocity)
        found += [noisy(recording(robot, f"run{k}_{turn}", time, q, torque), random, (0.005, 0.001)) for turn in (1, 2)]
    return found


@pytest.mark.slow
def test_a_sigmoid_is_found_with_its_size_and_speed_and_nothing_else() -> None:
    """It was `undecided` without a cause, with a negative Stribeck friction and elastic joints worth a look."""
    runs = recorded(0.05)
    found = diagnose(load_robot(), runs[:4], validation=runs[4:])
    assert found.verdict == "explained"
    (effect,) = found.effects
    assert (effect.effect, effect.joint) == ("smooth_coulomb", "joint2")
    for name, true in (("amplitude", 0.03), ("velocity", 0.05)):
        told = effect.parameters[name]
        assert abs(told.value - true) < 3.0 * told.std < 0.2 * true, name


@pytest.mark.slow
def test_friction_that_jumps_is_no_sigmoid() -> None:
    runs = recorded(1e-9)
    assert not diagnose(load_robot(), runs[:4], validation=runs[4:]).effects
