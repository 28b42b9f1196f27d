"""A weight that is not the URDF's beside an inertia that is, and rotors that are not as stated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.estimation import wls
from scara_ident.estimation.estimate import Estimate
from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.urdf_weight import otherwise_loaded, rotor_sentence, scale_in_words
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import prepare
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import PLANAR_2R, UP, Link, noisy, rnea, sines, swing, write_urdf

# A lift of 50 kg with an arm of 5 kg, and a rotor that counts 20 kg there.
LIFT = (Link("prismatic", axis=UP, mass=50.0), Link(axis=(0.0, 1.0, 0.0), mass=5.0))
SECONDS, RATE = 8.0, 200.0


@pytest.fixture
def lift(tmp_path: Path) -> Robot:
    write_urdf(tmp_path / "arm.urdf", LIFT)
    text = "urdf: arm.urdf\neffort_side: joint\njoints:\n  j1: {reduction: 100, rotor_inertia: 2.0e-3}\n  j2: {}\n"
    (tmp_path / "robot.yaml").write_text(text, encoding="utf-8")
    return load_robot(tmp_path / "robot.yaml")


def seen(
    robot: Robot, more: Sequence[np.ndarray | float] = (0.0, 0.0), gain: float = 1.0
) -> tuple[Estimate, Observations]:
    """Identify from efforts to which something was added, by joint."""
    run = swing(robot, seconds=SECONDS, rate=RATE)
    assert run.effort is not None
    effort = gain * (run.effort + np.array([np.broadcast_to(each, run.effort.shape[1:]) for each in more]))
    run = noisy(replace(run, effort=effort), np.random.default_rng(1), 0.05)
    observations = observe(build_model(robot, "basic"), prepare([run], (8.0, 8.0)))
    return wls(observations), observations


def state(robot: Robot) -> list[np.ndarray]:
    return sines(np.random.default_rng(0), np.arange(round(SECONDS * RATE)) / RATE, robot.n)


def test_a_counterweight_is_no_gain(lift):
    """`Torques of the bodies are 0.47 times the URDF's on hub: are effort_gain and effort_side right?` They were."""
    balance = 35.0
    found = seen(lift, (balance * (state(lift)[2][0] - 9.81), 0.0))
    (own,) = (loaded := otherwise_loaded(*found)).values()
    assert list(loaded) == ["j1"]
    # The offset of 0.1 N is taken for weight.
    assert own.weight == pytest.approx((55.0 - balance) / 55.0, rel=0.01)
    assert own.inertia == pytest.approx((75.0 + balance) / 75.0, rel=0.01)
    said = scale_in_words(*found)
    assert "right?" not in said
    assert said.endswith(
        "Weight and inertia of the bodies are 0.36 and 1.5 times the URDF's on j1, which no effort_gain explains: the URDF "
        "lacks a counterweight, a balancing spring or cylinder, or a payload."
    )
    # Seen at the lift its mass counts twice: in inertia for what it is, and for what the weight has lost.
    rotors = rotor_sentence(*found)
    assert rotors is not None
    assert rotors.startswith("Rotor inertia of j1: stated 0.002 kg m^2, identified 0.009 ± ")


@pytest.mark.parametrize("balance", [55.0, 70.0])
def test_one_that_bears_all_or_more_is_named_too(lift, balance):
    said = scale_in_words(*seen(lift, (balance * (state(lift)[2][0] - 9.81), 0.0)))
    assert "counterweight" in said
    assert "right?" not in said
    assert "negate" not in said


def test_a_wrong_gain_is_asked_for_and_nothing_else_and_of_a_right_arm_nothing(lift):
    right, wrong = seen(lift), seen(lift, gain=0.3)
    for found in (right, wrong):
        assert otherwise_loaded(*found) == {}
        assert rotor_sentence(*found) is None
    assert "right?" not in scale_in_words(*right)
    assert "All inertial parameters are 0.3 of the URDF's: are effort_gain and effort_side right?" in scale_in_words(
        *wrong
    )


def test_a_rotor_that_is_not_as_stated_is_said_alone(lift):
    found = seen(lift, (10.0 * state(lift)[2][0], 0.0))
    assert otherwise_loaded(*found) == {}
    said = rotor_sentence(*found)
    assert said is not None
    assert said.startswith("Rotor inertia of j1: stated 0.002 kg m^2, identified 0.003 ± ")
    assert rotor_sentence(*seen(lift, (1.0 * state(lift)[2][0], 0.0))) is None


def test_on_a_joint_that_turns_a_centre_of_mass_may_lie_elsewhere(tmp_path):
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R))
    q = state(robot)[0]
    weight = rnea(robot, q, np.zeros_like(q), np.zeros_like(q))[0]
    said = scale_in_words(*seen(robot, (-0.7 * weight, 0.0)))
    assert "times the URDF's on j1, which no effort_gain explains" in said
    assert said.endswith("or a payload, or a centre of mass in the URDF is wrong.")


def test_a_centre_of_mass_a_little_off_on_a_wrist_is_no_counterweight(tmp_path, monkeypatch):
    """UR5s whose centres of mass were 1.5 cm off were said to lack one at the first wrist joint."""
    near = Link(axis=(0.0, 1.0, 0.0), xyz=(0.4, 0.0, 0.0), mass=0.5, com=(0.02, 0.0, 0.0))
    other = replace(near, com=(0.06, 0.0, 0.0))
    (tmp_path / "robot.yaml").write_text(
        "urdf: arm.urdf\neffort_side: joint\njoints:\n  j1: {rotor_inertia: 0.1}\n  j2: {rotor_inertia: 0.01}\n"
    )
    write_urdf(tmp_path / "arm.urdf", (PLANAR_2R[0], other))
    run = swing(load_robot(tmp_path / "robot.yaml"), seconds=SECONDS, rate=RATE)
    write_urdf(tmp_path / "arm.urdf", (PLANAR_2R[0], near))
    observations = observe(build_model(load_robot(tmp_path / "robot.yaml"), "basic"), prepare([run], (8.0, 8.0)))
    found = wls(observations), observations
    assert otherwise_loaded(*found) == {}
    monkeypatch.setattr("scara_ident.estimation.urdf_weight.HEAVY", 0.0)
    assert list(otherwise_loaded(*found)) == ["j2"]
