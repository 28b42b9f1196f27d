"""Parameters and what runs differ by, fitted together."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.estimation import wls
from scara_ident.estimation.beside_runs import beside_runs
from scara_ident.estimation.observations import Observations, observe
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import prepare
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import PLANAR_2R, noisy, swing, write_urdf


@pytest.fixture(scope="module")
def robot(tmp_path_factory: pytest.TempPathFactory) -> Robot:
    return load_robot(write_urdf(tmp_path_factory.mktemp("arm") / "arm.urdf", PLANAR_2R))


def observed(robot: Robot, offset: float, seed: int = 0) -> Observations:
    """Three motions, each recorded twice, every run with offsets of its own on both joints."""
    rng, made = np.random.default_rng(seed), []
    for motion in (1, 2, 3):
        for repetition in (1, 2):
            run = noisy(swing(robot, f"s{motion}_{repetition}", motion, 12.0, 200.0), rng, 0.05)
            off = offset * rng.standard_normal((2, 1))
            made.append(replace(run, effort=run.effort + off, repetition=repetition, trajectory=f"s{motion}"))
    return observe(build_model(robot, "basic"), prepare(made, (8.0, 8.0)))


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_offsets_of_runs_are_not_taken_for_gravity_and_nothing_else_seems_to_differ(robot: Robot, seed: int):
    steady = wls(observed(robot, 0.0, seed))
    observations = observed(robot, 0.5, seed)
    plain = wls(observations)
    together = beside_runs(plain, observations)
    bodies = [k for k, name in enumerate(plain.model.names) if not name.startswith("p_o")]
    errors = [np.linalg.norm(((item.value - steady.value) / steady.std)[bodies]) for item in (plain, together)]
    assert errors[1] < 0.05 * errors[0]
    told = together.variation.sizes(robot)
    assert all(0.1 < told[joint]["offset"] < 1.0 for joint in robot.joints)
    assert all(size < 0.01 for kinds in told.values() for kind, size in kinds.items() if kind != "offset")
    # Its covariance had the differences already.
    assert together.covariance is plain.covariance


def test_where_runs_do_not_differ_the_estimate_stays(robot: Robot):
    observations = observed(robot, 0.0)
    plain = replace(wls(observations), variation=None)
    assert beside_runs(plain, observations) is plain
