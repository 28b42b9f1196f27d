"""What no recording tells is compared with the URDF."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from scara_ident.estimation import wls
from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.urdf_scale import (
    friction_sides,
    gravity_acts,
    scale_sentence,
    slight_joints,
    unlike_urdf,
    urdf_scale,
)
from scara_ident.estimation.urdf_weight import scale_in_words
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import prepare
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import PLANAR_2R, noisy, swing, write_urdf


@pytest.fixture(scope="module")
def arm(tmp_path_factory: pytest.TempPathFactory) -> tuple[Robot, Recording]:
    robot = load_robot(write_urdf(tmp_path_factory.mktemp("arm") / "arm.urdf", PLANAR_2R))
    return robot, noisy(swing(robot, seconds=8.0, rate=200.0), np.random.default_rng(1), 0.05)


def scales(robot: Robot, run: Recording, gains: tuple[float, float]) -> dict[str, float]:
    assert run.effort is not None
    scaled = replace(run, effort=run.effort * np.array(gains)[:, None])
    observations: Observations = observe(build_model(robot, "basic"), prepare([scaled], (8.0, 8.0)))
    return urdf_scale(wls(observations), observations)


@pytest.mark.parametrize(
    ("gains", "said"),
    [
        ((1.0, 1.0), r"Torques of the bodies are (those of the URDF|(0\.99|0\.99 to 1) times the URDF's)\."),
        ((0.01, 0.01), r"All inertial parameters are 0\.01 of the URDF's: is effort_gain right\?"),
    ],
)
def test_the_scale_of_each_joint_is_determined(arm, gains, said):
    robot, run = arm
    found = scales(robot, run, gains)
    # Noise of 0.05 N m, beside some 5 N m of gravity.
    assert list(found.values()) == pytest.approx(gains, rel=0.02)
    assert re.search(said, scale_sentence(found, robot))


def test_opposite_signs_are_said_first(arm):
    robot, run = arm
    found = scales(robot, run, (-1.0, -1.0))
    assert list(found.values()) == pytest.approx((-1.0, -1.0), rel=0.02)
    assert "the opposite sign of the URDF's on j1, j2: negate effort_gain there" in scale_sentence(found, robot)
    assert "the opposite sign of the URDF's on j2: negate" in scale_sentence({"j1": 30.0, "j2": -1.0}, robot)


def test_where_friction_brakes_no_gain_of_opposite_sign_is_suspected(tmp_path):
    """The centre of mass of the last link lay on the other side: the joint's effort, which was right, was to be negated."""
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R))
    run = noisy(swing(robot, seconds=8.0, rate=200.0), np.random.default_rng(1), 0.05)
    model = build_model(robot, "basic")
    rate = np.gradient(run.position, run.time, axis=1)
    braked = replace(run, effort=-run.effort + 2.0 * np.sign(rate))
    observations = observe(model, prepare([braked], (8.0, 8.0)))
    estimate = wls(observations)
    assert friction_sides(estimate, observations).brakes == robot.joints
    said = scale_in_words(estimate, observations)
    assert "the opposite sign of the URDF's on j1, j2, but friction brakes there" in said
    assert "negate" not in said
    pushed = observe(model, prepare([replace(run, effort=-run.effort - 2.0 * np.sign(rate))], (8.0, 8.0)))
    said = scale_in_words(wls(pushed), pushed)
    assert (
        "on j1, j2, and friction feeds energy in there: efforts or positions have the wrong sign; negate effort_gain"
        in said
    )


def test_friction_brakes_by_all_of_its_law_together(tmp_path):
    """An axis of an arm counts the other way round: of a law of four powers no coefficient was sure, and its effort was to be negated."""
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R))
    run = noisy(swing(robot, seconds=8.0, rate=200.0), np.random.default_rng(1), 0.05)
    rate = np.gradient(run.position, run.time, axis=1)
    # The arm's own Coulomb friction away, and viscous friction in its place.
    added = np.array([[0.4], [0.2]]) * np.sign(rate) + np.array([[-0.6], [0.6]]) * rate
    observations = observe(
        build_model(robot, "complete"), prepare([replace(run, effort=-run.effort + added)], (8.0, 8.0))
    )
    estimate = wls(observations)
    coulomb = [estimate.model.names.index(name) for name in ("a01", "a02")]
    assert np.all(np.abs(estimate.value[coulomb]) < 5.0 * estimate.std[coulomb])
    found = friction_sides(estimate, observations)
    assert found.brakes == ("j2",) and found.pushes == ("j1",)
    said = scale_in_words(estimate, observations)
    assert "on j1, and friction feeds energy in there" in said
    assert "They also have the opposite sign on j2, but friction brakes there" in said


def test_joints_that_differ_are_named(arm):
    said = scale_sentence({"j1": 1.1, "j2": 30.0}, arm[0])
    assert said.endswith(
        "Torques of the bodies are 30 times the URDF's on j2: is effort_gain right there, or do the masses differ?"
    )


def test_the_scale_of_one_joint_of_many_is_not_that_of_all(arm):
    """`All inertial parameters are 2.2 of the URDF's` rested on the fifth of six joints."""
    robot, _ = arm
    said = scale_sentence({"j2": 3.0}, robot)
    assert said.endswith("Torques of the bodies are 3 times the URDF's on j2: is effort_gain right?")


def test_behind_a_gear_the_side_may_be_wrong_too(arm):
    robot, _ = arm
    geared = replace(robot, reduction=np.array([100.0, 100.0]))
    assert "are effort_gain and effort_side right?" in scale_sentence({"j1": 100.0, "j2": 110.0}, geared)


def test_a_urdf_that_does_not_show_says_nothing_of_scale(arm):
    robot, run = arm
    assert run.effort is not None
    rng = np.random.default_rng(2)
    assert scales(robot, replace(run, effort=rng.standard_normal(run.effort.shape)), (1.0, 1.0)) == {}
    # A KUKA's second joint follows its URDF with a correlation of 0.998, in too few samples to tell the scale.
    assert scale_sentence({}, robot).endswith(
        "these recordings do not show whether the torques are those of the URDF's bodies."
    )
    assert scale_sentence(None, robot) == (
        "Recordings cannot determine a common scale of all torques and masses: it depends on effort_gain."
    )


def test_what_has_no_finite_variance_says_nothing_of_scale(arm):
    robot, run = arm
    observations = observe(build_model(robot, "basic"), prepare([run], (8.0, 8.0)))
    estimate = wls(observations)
    free = [k for k, name in enumerate(estimate.model.names) if "2" in name]
    covariance = estimate.covariance.copy()
    # With what others share with it, which is no covariance once its variance is left out.
    covariance[np.ix_(free, free)] = -1.0
    covariance[free, free] = np.inf
    assert list(urdf_scale(replace(estimate, covariance=covariance), observations)) == ["j1"]


def test_joints_left_out_are_named(arm, tmp_path):
    """The second link carries beside its axis what the URDF has before it: as a torque it is another, in any scale."""
    robot, run = arm
    other = load_robot(write_urdf(tmp_path / "other.urdf", [PLANAR_2R[0], replace(PLANAR_2R[1], com=(0.0, 0.0, 0.12))]))
    observations = observe(build_model(other, "basic"), prepare([run], (8.0, 8.0)))
    seen = wls(observations), observations
    assert list(urdf_scale(*seen)) == ["j1"]
    assert unlike_urdf(*seen) == ("j2",)
    assert scale_sentence(urdf_scale(*seen), other, unlike_urdf(*seen)).endswith(
        "On j2 no scale makes them those of the URDF."
    )
    own = observe(build_model(robot, "basic"), prepare([run], (8.0, 8.0)))
    assert unlike_urdf(wls(own), own) == ()


def test_of_time_it_is_said_where_no_joint_feels_gravity(arm):
    robot, _ = arm
    upright = load_robot()
    assert (gravity_acts(robot), gravity_acts(upright)) == (True, False)
    assert ", nor, without gravity, the scale of time: these depend on effort_gain" in scale_sentence(None, upright)
    assert "time" not in scale_sentence(None, robot)


def test_nothing_is_asked_for_a_light_joint_whose_centre_of_mass_is_a_little_off(tmp_path):
    """Four sets of a UR10 were asked whether its gains are right: of a wrist of 0.17 N m, beside 270 on the shoulder."""
    near = replace(PLANAR_2R[1], mass=0.5, com=(0.001, 0.0, 0.0), inertia=(1e-5, 1e-4, 1e-4))
    stated = load_robot(write_urdf(tmp_path / "stated.urdf", [PLANAR_2R[0], near]))
    off = load_robot(write_urdf(tmp_path / "off.urdf", [PLANAR_2R[0], replace(near, com=(0.006, 0.0, 0.0))]))
    run = noisy(swing(off, seconds=8.0, rate=200.0), np.random.default_rng(1), 0.001)
    observations = observe(build_model(stated, "basic"), prepare([run], (8.0, 8.0)))
    seen = wls(observations), observations
    assert urdf_scale(*seen)["j2"] > 2.0
    assert slight_joints(*seen) == ("j2",)
    said = scale_in_words(*seen)
    assert "right?" not in said
    assert said.endswith(
        " times the URDF's on j2, but they are so small there that a small error of a centre of mass explains this."
    )
    # Of a joint that bears much it is asked, and of all alike.
    heavy = observe(build_model(stated, "basic"), prepare([replace(run, effort=100.0 * run.effort)], (8.0, 8.0)))
    assert slight_joints(wls(heavy), heavy) == ()
    assert "right?" in scale_in_words(wls(heavy), heavy)
    alike = scale_sentence({"j1": 100.0, "j2": 110.0}, stated, (), ("j2",))
    assert alike.endswith("All inertial parameters are 1e+02 of the URDF's: is effort_gain right?")
    for alone in (-4.0, 4.0):
        assert (
            f"Torques of the bodies are {alone:g} times the URDF's on j2, but they are so small there"
            in scale_sentence({"j2": alone}, stated, (), ("j2",))
        )
