"""Slopes of the design problem against differences."""

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.excitation import ExcitationTrajectory, information_of
from scara_ident.excitation.clearance import TOLERANCE, WATCHED_DISTANCE
from scara_ident.excitation.limits import limits_of
from scara_ident.excitation.problem import row_names
from scara_ident.excitation.search import _random_motion
from scara_ident.excitation.verification import grid
from scara_ident.robot.robot import load_robot
from tests.excitation.made import rigid_model, small_problem
from tests.excitation.problems import PROBLEMS, inside


@pytest.mark.parametrize("name", PROBLEMS)
def test_gradient_and_slopes_are_those_of_differences(name):
    problem = PROBLEMS[name]
    x = inside(problem)
    point = problem.at(x)
    slopes = problem.slopes(point)
    assert slopes.cost == pytest.approx(point.cost, rel=1e-12)
    # Beyond the limits they are at hand too.
    whole = problem.whole(3.0 * x)
    assert np.isinf(problem.at(3.0 * x).cost) and np.isfinite(whole.cost)
    np.testing.assert_array_equal(whole.values, problem.limited(3.0 * x))
    np.testing.assert_array_equal(problem.whole(x).values, point.values)
    rng = np.random.default_rng(5)
    for _ in range(4):
        direction = rng.standard_normal(x.shape) * np.abs(x).max() * 1e-4
        points = {k: problem.at(x + k * direction) for k in (-3, -2, -1, 1, 2, 3)}
        moved = {k: (each.cost, each.values) for k, each in points.items()}
        weights = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
        slope = sum(w * (moved[k][0] - moved[-k][0]) for k, w in weights.items())
        change = sum(w * (moved[k][1] - moved[-k][1]) for k, w in weights.items())
        foreseen = np.sum(slopes.gradient.reshape(x.shape) * direction)
        size = np.linalg.norm(slopes.gradient) * np.linalg.norm(direction)
        assert slope == pytest.approx(foreseen, abs=1e-6 * size)
        pushed = slopes.push(direction.reshape(len(x), -1))
        # Coal finds a distance to its tolerance, of which the rows have 1 / REACH, and the weights add up to less than 2.
        distances = np.array([name.startswith("distance") for name, _ in row_names(problem.task.limits, x.shape[1])])
        np.testing.assert_allclose(pushed[~distances], change[~distances], atol=1e-7 * np.abs(pushed).max())
        np.testing.assert_allclose(pushed[distances], change[distances], atol=2.0 * TOLERANCE / WATCHED_DISTANCE)


def test_no_motion_is_faster_than_its_range_and_its_frequencies_leave_it():
    """That of the highest frequency alone is just as fast (Bernstein), and a limit below it counts."""
    limits = limits_of(load_robot(), share=1.0, velocities={"joint1": 1000.0, "joint2": 0.1})
    task = replace(small_problem(rigid_model(load_robot()), lengths=((8.0, 6), (4.0, 5))).task, limits=limits)
    half = 0.5 * (limits.upper - limits.lower)
    np.testing.assert_allclose(task.speed, [2.0 * np.pi * (5 / 4.0) * half[0], 0.1])
    time = np.linspace(0.0, 4.0, 4001)
    for seed in range(20):
        x = np.random.default_rng(seed).normal(size=task.bases[1].size)
        q, v = (task.bases[1].rows(time, k) @ x for k in range(2))
        assert np.max(np.abs(v)) <= task.speed[0] / half[0] * np.max(np.abs(q))


def test_motions_of_two_lengths_count_by_their_samples():
    model = rigid_model(load_robot())
    problem = small_problem(model, lengths=((8.0, 6), (4.0, 5)))
    task = replace(problem.task, weights=np.ones(2))
    assert task.samples == (500, 250)
    x = 0.1 * _random_motion(task, np.random.default_rng(0))
    # As dense as the samples, so that both sums are integrals; the samples have both ends of a period.
    cost = replace(problem, task=task, rows=grid(task.bases, 1000)).at(x).cost
    parts = [
        information_of(
            model, ExcitationTrajectory("m", model.robot.joints, basis, task.posture, own[:, : basis.size]), size
        )
        for basis, own, size in zip(task.bases, x, task.samples, strict=True)
    ]
    gram = sum(part.regressor_factor.T @ part.regressor_factor for part in parts)
    assert -cost == pytest.approx(np.linalg.slogdet(gram)[1], abs=0.02)
