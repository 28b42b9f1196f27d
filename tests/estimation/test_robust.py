"""The bounded-influence fit: least squares where nothing stands out, and not steered by a stretch that does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.estimation import wls
from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.robust import disagreement, robust_fit
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import prepare
from scara_ident.recording.recording import Recording, read_recording
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import noisy, swing
from tests.shared import shared_path

ROBOT = load_robot()


def observed(robot: Robot, runs: list[Recording]) -> Observations:
    return observe(build_model(robot, "complete"), prepare(runs, (8.0, 8.0)))


def runs() -> list[Recording]:
    rng = np.random.default_rng(3)
    return [noisy(swing(ROBOT, f"swing_{k}", seed=k, seconds=15.0, rate=250.0), rng, 0.02) for k in range(3)]


def pushed(run: Recording) -> Recording:
    """With 1 N m for 2 s, fifty times the noise."""
    assert run.effort is not None
    return replace(run, effort=run.effort + np.where((run.time > 6.0) & (run.time < 8.0), 1.0, 0.0))


def test_where_nothing_stands_out_it_is_least_squares():
    observations = observed(ROBOT, runs())
    estimate, robust = wls(observations), robust_fit(observations)
    # The efficiency of the weights is above 90 %: a third of a standard deviation is what they may differ by.
    known = ~estimate.undetermined
    assert np.max(np.abs(robust.value - estimate.value)[known] / estimate.std[known]) < 1.0
    assert disagreement(estimate, robust) is None


def test_a_push_does_not_steer_it_and_the_difference_is_said():
    plain = runs()
    truth = wls(observed(ROBOT, plain))
    observations = observed(ROBOT, [pushed(plain[0]), *plain[1:]])
    estimate, robust = wls(observations), robust_fit(observations)
    known = ~truth.undetermined
    steered = np.abs(estimate.value - truth.value)[known] / truth.std[known]
    bounded = np.abs(robust.value - truth.value)[known] / truth.std[known]
    assert steered.max() > 5.0
    assert bounded.max() < 1.5
    assert min(float(weights.min()) for weights in robust.weights) < 0.01
    shifted = replace(estimate, covariance=truth.covariance)
    said = disagreement(shifted, robust)
    assert said is not None
    assert "std" in said


def test_directions_that_the_data_leave_open_do_not_run_away():
    """Of four joints that stand still it took a few rows, met exactly, for noise of 1e-8, and parameters for 1e8."""
    arm = load_robot(shared_path("data", "ur10e", "robot.yaml"))
    run = [read_recording(shared_path("data", "ur10e", f"jointwise_{k}.parquet"), arm) for k in (1, 2)]
    observations = observe(build_model(arm, "basic"), prepare(run, (2.4,) * arm.n))
    estimate, robust = wls(observations), robust_fit(observations)
    few = [part.rows < 5 for part in observations.by_joint]
    assert any(few)
    assert np.all(robust.noise[few] > 0.01)
    known = ~estimate.undetermined
    assert np.max(np.abs(robust.value - estimate.value)[known] / estimate.std[known]) < 3.0
