"""The interior-point method stays inside and ends at the limits."""

import numpy as np

from scara_ident.excitation.interior_point import Schedule, minimise
from tests.excitation.problems import PROBLEMS, inside


def test_every_step_of_the_search_stays_inside_and_gains():
    problem = PROBLEMS["logdet"]
    x = inside(problem)
    costs = [problem.sharpened(1.0).values(x)[0]]
    for steps in (20, 80):
        found = minimise(problem, x, Schedule(steps=steps))
        assert found.steps <= steps
        cost, values = problem.sharpened(1.0).values(found.x)
        bounds = problem.bounds[:, None]
        assert np.isfinite(cost) and np.all(values < bounds)
        assert np.all(-values[problem.two_sided] < bounds[problem.two_sided])
        costs.append(cost)
    assert costs[2] < costs[1] < costs[0] - 10.0


def test_the_optimum_meets_limits_exactly():
    problem = PROBLEMS["logdet"]
    found = minimise(problem, inside(problem))
    values = problem.values(found.x)[1]
    assert np.max(values[:4]) > 0.99
    # No short step along the gradient that stays inside gains anything worth having.
    slopes = problem.sharpened(1.0).slopes(found.x)
    step = -slopes.gradient.reshape(found.x.shape)
    for length in 10.0 ** np.arange(-9.0, 0.0):
        cost, moved = problem.sharpened(1.0).values(found.x + length * step)
        if np.isfinite(cost) and np.all(np.abs(moved) < 0.999):
            assert cost > found.cost - 0.05
