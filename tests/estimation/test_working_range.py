"""What data do not tell within the drives' torque is left open, and what they tell is not touched."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.arrays import Array
from scara_ident.estimation.information import residual_noise, weighted
from scara_ident.estimation.least_squares import determined_value_and_weights, ols, wls
from scara_ident.estimation.observations import Observations, observe
from scara_ident.estimation.working_range import believable, determined_directions
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import prepare
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import recorded_torque, recording, sines

FRICTION = ((2.0, 1.0, 0.0, 0.0, 0.1), (1.0, 0.5, 0.0, 0.0, -0.1))
BANDS = (6.0, 6.0)
RATE = 200.0


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


def observations(robot: Robot, seed: int, size: tuple[float, float], noise: float = 0.02, model: str = "complete"):
    """Make a run whose joints move by so large a share of the whole motion; position noise as of an encoder."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(20.0 * RATE)) / RATE
    q, v, a = (np.array(size)[:, None] * signal for signal in sines(rng, time, robot.n))
    torque = recorded_torque(robot, q, v, a, FRICTION)
    q = q + 2e-5 * rng.standard_normal(q.shape)
    made = recording(robot, f"run_{seed}", time, q, torque + noise * rng.standard_normal(torque.shape))
    return observe(build_model(robot, model), prepare([made], BANDS))


def largest_error(value: Array, other: Observations) -> float:
    """Worst joint's error in shares of its torque."""
    return float(np.max(other.unfiltered_rms(value) / other.unfiltered_torque_rms))


def test_an_arm_that_moves_leaves_nothing_open(robot: Robot):
    found = observations(robot, 1, (1.0, 1.0))
    plain = weighted(found.by_joint, np.ones(robot.n)).solve()
    assert determined_directions(found, residual_noise(found.by_joint, plain.value)) is None
    np.testing.assert_array_equal(ols(found).value, plain.value)
    assert not np.any(ols(found).undetermined)


def test_a_joint_that_hardly_moves_does_not_make_absurd_predictions(robot: Robot):
    """Least squares alone is off by many times the torque; what is left open is named."""
    still, whole = observations(robot, 2, (0.2, 2e-4)), observations(robot, 3, (1.0, 1.0))
    plain = weighted(still.by_joint, np.ones(robot.n)).solve()
    assert largest_error(plain.value, whole) > 10.0
    for estimate in (wls(still),):
        assert largest_error(estimate.value, whole) < 2.0
        assert np.any(estimate.undetermined)
        assert np.all(np.isinf(estimate.std[estimate.undetermined]))
        assert np.all(np.isfinite(estimate.std[~estimate.undetermined]))


def test_parameters_without_a_covariance_are_those_with_one(robot: Robot):
    for seed, size in ((1, (1.0, 1.0)), (2, (0.2, 2e-4))):
        found = observations(robot, seed, size)
        value, weights = determined_value_and_weights(found)
        np.testing.assert_array_equal(value, wls(found).value)
        np.testing.assert_array_equal(weights, wls(found).weights)


def test_directions_left_open_are_at_zero(robot: Robot):
    still = observations(robot, 2, (0.2, 2e-4))
    estimate = wls(still)
    told = determined_directions(
        still, residual_noise(still.by_joint, weighted(still.by_joint, estimate.weights).solve().value)
    )
    assert told is not None
    both = np.column_stack([told.kept, told.left_open])
    coordinates = np.linalg.solve(both, estimate.value)
    np.testing.assert_allclose(coordinates[told.kept.shape[1] :], 0.0, atol=1e-9 * np.max(np.abs(coordinates)))
    # Kept and open directions are orthogonal on the weighted rows, so that the fit along one does not move the other.
    rows = weighted(still.by_joint, estimate.weights).regressor_factor
    cross = (rows @ told.kept).T @ (rows @ told.left_open)
    size = np.linalg.norm(rows @ told.kept, axis=0)[:, None] * np.linalg.norm(rows, 2) * np.linalg.norm(told.left_open)
    assert np.max(np.abs(cross) / size) < 1e-6


def test_a_drive_that_is_stated_far_too_weak_is_as_strong_as_it_was_seen(robot: Robot):
    weak = replace(robot, effort_limit=np.full(robot.n, 1e-6), velocity_limit=np.full(robot.n, 1e4))
    found = observations(weak, 1, (1.0, 1.0), model="basic")
    assert determined_directions(found, residual_noise(found.by_joint, wls(found).value)) is None
    unstated = replace(robot, effort_limit=np.full(robot.n, np.inf), velocity_limit=np.full(robot.n, np.inf))
    found = observations(unstated, 1, (1.0, 1.0))
    assert determined_directions(found, residual_noise(found.by_joint, wls(found).value)) is None


def test_a_slow_motion_foresees_the_torques_of_a_fast_one(robot: Robot):
    """Powers of a speed that was hardly there make friction of many times the real one where the arm is fast."""
    slow, fast = observations(robot, 5, (0.05, 0.05), noise=0.2), observations(robot, 6, (1.0, 1.0))
    plain, noise = weighted(slow.by_joint, np.ones(robot.n)).solve().value, np.array([0.2, 0.02]) ** 2 / RATE
    assert largest_error(plain, fast) > 10.0
    found = believable(slow, plain, np.full(robot.n, noise[0]))
    # Better than what leaves at zero what no data tell, too.
    assert largest_error(found, fast) < 0.7 * largest_error(wls(slow).value, fast)
    # What data tell it leaves as it was.
    told = wls(fast).value
    assert largest_error(believable(fast, told, np.full(robot.n, noise[1])), fast) < 1.02 * largest_error(told, fast)


@pytest.mark.parametrize(("size", "same"), [(1.0, True), (0.05, False)])
def test_an_estimate_that_is_determined_well_is_believed_itself(robot: Robot, size: float, same: bool):
    """What was made of it need not be made again."""
    found = observations(robot, 6, (size, size), noise=1e-3)
    told = wls(found).value
    assert (believable(found, told, np.full(robot.n, 1e-6 / RATE)) is told) == same


def test_a_joint_whose_noise_is_not_known_says_nothing(robot: Robot):
    found = observations(robot, 6, (1.0, 1.0))
    told, noise = wls(found).value, 0.02**2 / RATE
    both, one = (believable(found, told, np.array([noise, other])) for other in (noise, np.inf))
    assert np.all(np.isfinite(one))
    own = [name.endswith("2") and name[0] in "ap" for name in found.model.names]
    # Friction of joint 2 is what is known without data, and joint 1 is as its own data tell.
    assert not np.allclose(one[own], told[own], rtol=0.01)
    error = found.unfiltered_rms(one) - found.unfiltered_rms(both)
    assert abs(error[0]) < 0.01 * found.unfiltered_torque_rms[0] < 0.01 * found.unfiltered_torque_rms[0] + error[1]
