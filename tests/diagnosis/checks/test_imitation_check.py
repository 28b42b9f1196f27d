"""A force that pulls at the tool is no base that leans, and a base that leans is one though a force does some of it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scara_ident.diagnosis.diagnose import Diagnosis, diagnose
from scara_ident.effects import effects_named
from scara_ident.model.regressor.kernel import configurations
from scara_ident.robot.kinematics import force_torques
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import Link, recorded_torque, recording, sines, write_urdf
from tests.effects.test_tilt import leaning

# Three joints of which two lift: a force and gravity are differently shared between them.
LINKS = (
    Link(mass=4.0, inertia=(0.1, 0.1, 0.1)),
    Link(axis=(0.0, 1.0, 0.0), xyz=(0.0, 0.0, 0.3), mass=6.0, com=(0.25, 0.0, 0.0), inertia=(0.1, 0.3, 0.3)),
    Link(axis=(0.0, 1.0, 0.0), xyz=(0.5, 0.0, 0.0), mass=2.0, com=(0.1, 0.0, 0.0), inertia=(0.05, 0.1, 0.1)),
)
FRICTION = [(1.0, 0.5, 0.0, 0.0, 0.1)] * 3


@pytest.fixture
def arm(tmp_path: Path) -> Robot:
    return load_robot(write_urdf(tmp_path / "arm.urdf", LINKS))


def diagnosed(robot: Robot, tilt: tuple[float, float], force: tuple[float, float, float], *names: str) -> Diagnosis:
    runs, rng, time = [], np.random.default_rng(3), np.arange(2500) / 250.0
    for k in range(4):
        q, v, a = sines(rng, time, 3, size=0.8, lowest=0.2)
        states = configurations(robot.model, q[np.argsort(robot.order)]).T
        pulled = np.einsum("tja,a->jt", np.array(list(force_torques(robot, states))), np.array(force))
        torque = recorded_torque(leaning(robot, tilt), q, v, a, FRICTION) - pulled
        noise = 0.02 * np.max(np.abs(torque), axis=1, keepdims=True) * rng.standard_normal(torque.shape)
        runs.append(recording(robot, f"t{k}_1", time, q, torque + noise))
    return diagnose(robot, runs[:3], validation=runs[3:], catalogue=effects_named("base_tilt", *names))


@pytest.mark.parametrize("force", [(4.0, -3.0, 0.0), (2.0, -1.0, 0.0)])
def test_a_force_on_the_tool_is_not_believed_to_be_a_base_that_leans(arm: Robot, force: tuple[float, float, float]):
    """It was `explained` by a base that leans by 0.08 and 0.04 rad."""
    result = diagnosed(arm, (0.0, 0.0), force)
    assert not result.effects and result.verdict != "explained"
    (guess,) = result.tentative
    assert guess.effect == "base_tilt"
    assert (
        guess.why
        == "a constant force on the tool explains as much in its place, and with it in the model 0% of this effect is left"
    )


@pytest.mark.parametrize("force", [(4.0, -3.0, 0.0), (8.0, -6.0, 5.0)])
def test_nor_does_a_spring_stand_for_it(arm: Robot, force: tuple[float, float, float]):
    """Without the tilt, which is refused or would be seen by eye, what a force does all of was left to springs and counterbalances."""
    result = diagnosed(arm, (0.0, 0.0), force, "spring", "gravity_counterbalance")
    assert not result.effects
    assert "a constant force on the tool explains as much in its place" in {item.why for item in result.tentative}


def test_a_base_that_leans_is_found_beside_what_a_force_would_do(arm: Robot):
    (found,) = diagnosed(arm, (0.03, -0.02), (0.0, 0.0, 0.0)).effects
    assert found.effect == "base_tilt"
    for axis, size in zip("xy", (0.03, -0.02), strict=True):
        item = found.parameters[f"tilt_{axis}"]
        assert abs(item.value - size) < 3.0 * item.std
