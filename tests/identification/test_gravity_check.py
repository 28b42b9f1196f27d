"""Gravity that points elsewhere than the description says, of arms that weigh something else than their URDF."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.urdf_gravity import gravity_sentence, urdf_gravity
from scara_ident.identification.few_rows import few_rows
from scara_ident.identification.gravity_check import gravity_said, left_under, other_gravities
from scara_ident.identification.identify import identify
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import prepare
from scara_ident.recording.recording import Recording
from scara_ident.report.identification import sentences
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import PLANAR_2R, noisy, recorded_torque, recording, sines, write_urdf
from tests.estimation.test_urdf_gravity import ARM

DOWN, UP = np.array([0.0, 0.0, -9.81]), np.array([0.0, 0.0, 9.81])


def made(
    folder: Path, true: np.ndarray, stated: np.ndarray, links=ARM, friction: float = 1.0
) -> tuple[Robot, Recording]:
    """An arm under a gravity, and its description: bodies that lie elsewhere and weigh something else, under another."""
    arm = load_robot(write_urdf(folder / "true.urdf", links))
    arm.model.gravity.linear = true
    rng, time = np.random.default_rng(3), np.arange(2400) / 200.0
    q, v, a = sines(rng, time, arm.n)
    law = (0.4 * friction, 0.3 * friction, 0.0, 0.0, 0.1)
    run = recording(arm, "run_1", time, q, recorded_torque(arm, q, v, a, (law,) * arm.n))
    other = [
        replace(link, mass=size * link.mass, com=(-0.1, 0.15, 0.05))
        for link, size in zip(links, (0.3, 4.0, 0.2), strict=False)
    ]
    described = load_robot(write_urdf(folder / "arm.urdf", other))
    described.model.gravity.linear = stated
    return described, noisy(run, rng, 0.05)


def seen(robot: Robot, run: Recording) -> Observations:
    return observe(build_model(robot, "basic"), prepare([run], (8.0,) * robot.n))


@pytest.mark.parametrize(
    ("true", "stated", "said"),
    [
        (DOWN, UP, "point along [0, 0, -1] of the base, 180 degrees"),
        (UP, DOWN, "point along [0, 0, 1] of the base, 180 degrees"),
        (np.array([9.81, 0.0, 0.0]), DOWN, "state gravity: [9.81, 0, 0]"),
        (DOWN, DOWN, None),
    ],
)
def test_another_gravity_is_reported_of_an_arm_unlike_its_urdf(
    tmp_path: Path, true: np.ndarray, stated: np.ndarray, said: str | None
) -> None:
    observations = seen(*made(tmp_path, true, stated))
    shown = urdf_gravity(observations)
    assert shown is not None and not shown.elsewhere and not shown.borne_out
    found = gravity_said(observations)
    assert found is None if said is None else said in str(found)


def test_of_one_joint_neither_is_reported(tmp_path: Path) -> None:
    """The mass of a pendulum may lie on the other side of its axis as well."""
    observations = seen(*made(tmp_path, DOWN, UP, PLANAR_2R[:1]))
    assert "point along" not in str(gravity_said(observations))


def test_gravity_that_free_bodies_show_is_not_said_to_be_missing(tmp_path: Path) -> None:
    """Of bodies that weigh a tenth of the URDF's, and turn as heavily as its rotors had them, nothing seemed to be there."""
    robot, run = made(tmp_path, DOWN, DOWN)
    observations = seen(robot, run)
    shown = urdf_gravity(observations)
    assert shown is not None
    small = replace(shown, found=0.05 * shown.stated, covariance=1e-6 * np.eye(3), inertia=1.0, inertia_std=0.01)
    assert "but no gravity" in str(gravity_sentence(small))
    observations.__dict__["_urdf_gravity"] = small
    assert gravity_said(observations) is None


def test_what_is_left_under_the_true_gravity_is_least(tmp_path: Path) -> None:
    rows = few_rows(seen(*made(tmp_path, DOWN, UP)))
    others = list(other_gravities(UP))
    # Six directions and none twice but for the opposite one, which is an axis too.
    assert len(others) == 6
    assert min(others, key=lambda gravity: left_under(rows, gravity)) == pytest.approx(DOWN)


def test_an_identification_says_it(tmp_path: Path) -> None:
    robot, run = made(tmp_path, DOWN, UP)
    said = sentences(identify(robot, [run], model="basic", bands=(8.0,) * 3))
    assert any(text.startswith("Gravity seems to point along [0, 0, -1]") for text in said)
