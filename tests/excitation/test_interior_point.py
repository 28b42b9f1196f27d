"""The interior-point method stays inside and ends at the limits."""

import numpy as np

from scara_ident.excitation.interior_point import Schedule, minimise
from tests.excitation.problems import PROBLEMS, inside


def test_every_step_of_the_search_stays_inside_and_gains():
    problem = PROBLEMS["logdet"]
    x = inside(problem)
    costs = [problem.sharpened(1.0).at(x).cost]
    for steps in (20, 80):
        found = minimise(problem, x, Schedule(steps=steps))
        assert found.steps <= steps
        there = problem.sharpened(1.0).at(found.x)
        cost, values = there.cost, there.values
        bounds = problem.bounds[:, None]
        assert np.isfinite(cost) and np.all(values < bounds)
        assert np.all(-values[problem.two_sided] < bounds[problem.two_sided])
        costs.append(cost)
    assert costs[2] < costs[1] < costs[0] - 10.0


def test_the_optimum_meets_limits_exactly():
    problem = PROBLEMS["logdet"]
    found = minimise(problem, inside(problem))
    values = problem.at(found.x).values
    assert np.max(values[:4]) > 0.99
    # No short step along the gradient that stays inside gains anything worth having.
    sharp = problem.sharpened(1.0)
    slopes = sharp.slopes(sharp.at(found.x))
    step = -slopes.gradient.reshape(found.x.shape)
    for length in 10.0 ** np.arange(-9.0, 0.0):
        there = sharp.at(found.x + length * step)
        if np.isfinite(there.cost) and np.all(np.abs(there.values) < 0.999):
            assert there.cost > found.cost - 0.05
