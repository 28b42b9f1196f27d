"""Gravity that the efforts do not hold, or that points elsewhere than the description says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.urdf_gravity import UrdfGravity, gravity_sentence, urdf_gravity
from scara_ident.identification.identify import identify
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import prepare
from scara_ident.recording.recording import Recording
from scara_ident.report.identification import sentences
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import PLANAR_2R, Link, noisy, recorded_torque, recording, sines, write_urdf

# An upright axis and two that lie: with another gravity each of them carries.
ARM = (
    Link(axis=(0.0, 0.0, 1.0), mass=4.0, com=(0.05, 0.0, 0.1)),
    *(replace(link, xyz=(0.0, 0.0, 0.3) if k == 0 else link.xyz) for k, link in enumerate(PLANAR_2R)),
)
STATED = (0.0, 0.0, -9.81)


def made(folder: Path, gravity: tuple[float, ...], heavier: float = 1.0, gain: float = 1.0) -> tuple[Robot, Recording]:
    """Return the arm as described, and a recording of one of other masses under another gravity."""
    true = load_robot(write_urdf(folder / "true.urdf", [replace(link, mass=heavier * link.mass) for link in ARM]))
    true.model.gravity.linear = np.array(gravity)
    rng, time = np.random.default_rng(3), np.arange(2400) / 200.0
    q, v, a = sines(rng, time, 3)
    effort = gain * recorded_torque(true, q, v, a, ((0.4, 0.3, 0.0, 0.0, 0.1),) * 3)
    run = noisy(recording(true, "run_1", time, q, effort), rng, 0.05)
    return load_robot(write_urdf(folder / "arm.urdf", ARM)), run


def seen(robot: Robot, run: Recording) -> Observations:
    return observe(build_model(robot, "basic"), prepare([run], (8.0,) * robot.n))


def fitted(robot: Robot, run: Recording) -> UrdfGravity:
    found = urdf_gravity(seen(robot, run))
    assert found is not None
    return found


@pytest.mark.parametrize(
    ("gravity", "said"),
    [
        ((9.81, 0.0, 0.0), "point along [1, 0, 0] of the base, 90 degrees"),
        ((9.81, 0.0, 0.0), "state gravity: [9.81, 0, 0] in robot.yaml"),
        ((6.94, 0.0, -6.94), "point along [0.7"),
        ((0.0, 0.0, 9.81), "point along [0, 0, 1] of the base, 180 degrees"),
        ((0.0, 0.0, 0.0), "contain the inertia of the URDF but no gravity"),
    ],
)
def test_another_gravity_is_reported(tmp_path: Path, gravity: tuple[float, ...], said: str) -> None:
    found = fitted(*made(tmp_path, gravity))
    # Noise of 0.05 N m, beside gravity of some 10 N m, in hundreds of independent rows.
    np.testing.assert_allclose(found.found, gravity, atol=0.05)
    assert np.all(np.abs(found.found - gravity) < 5.0 * np.sqrt(np.diag(found.covariance)))
    assert said in str(gravity_sentence(found))


@pytest.mark.parametrize(("heavier", "gain"), [(1.0, 1.0), (1.5, 1.0), (1.0, 0.01), (1.0, -1.0)])
def test_nothing_is_said_of_the_stated_one(tmp_path: Path, heavier: float, gain: float) -> None:
    """Nor where masses or gains are wrong, nor where all efforts have the opposite sign."""
    found = fitted(*made(tmp_path, STATED, heavier, gain))
    assert gravity_sentence(found) is None


@pytest.mark.parametrize(
    ("gravity", "said"), [(STATED, None), ((9.81, 0.0, 0.0), "point along [1, "), ((0.0, 0.0, 0.0), "but no gravity")]
)
def test_a_pendulum_shows_gravity_across_its_axes(tmp_path: Path, gravity: tuple[float, ...], said: str | None) -> None:
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R))
    true = load_robot(write_urdf(tmp_path / "true.urdf", PLANAR_2R))
    true.model.gravity.linear = np.array(gravity)
    rng, time = np.random.default_rng(3), np.arange(2400) / 200.0
    q, v, a = sines(rng, time, 2)
    run = recording(robot, "run_1", time, q, recorded_torque(true, q, v, a, ((0.4, 0.3, 0.0, 0.0, 0.1),) * 2))
    found = fitted(robot, noisy(run, rng, 0.05))
    np.testing.assert_allclose(found.found, gravity, atol=0.1)
    sentence = gravity_sentence(found)
    assert sentence is None if said is None else said in str(sentence)


def test_nothing_is_said_of_upright_axes(tmp_path: Path) -> None:
    upright = [replace(link, axis=(0.0, 0.0, 1.0)) for link in PLANAR_2R]
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", upright))
    time = np.arange(2400) / 200.0
    q, v, a = sines(np.random.default_rng(3), time, 2)
    run = recording(robot, "run_1", time, q, recorded_torque(robot, q, v, a, ((0.4, 0.3, 0.0, 0.0, 0.1),) * 2))
    assert urdf_gravity(seen(robot, noisy(run, np.random.default_rng(0), 0.05))) is None


def test_an_identification_says_it(tmp_path: Path) -> None:
    robot, run = made(tmp_path, (0.0, 0.0, 0.0))
    said = sentences(identify(robot, [run], model="basic", bands=(8.0,) * 3))
    assert any(text.startswith("These efforts contain the inertia of the URDF but no gravity") for text in said)
