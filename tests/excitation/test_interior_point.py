"""The interior-point method stays inside and ends at the limits."""

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.excitation.interior_point import Schedule, minimise, moved_inside, shrunk_inside
from scara_ident.model.model import build_model
from tests.excitation.made import BALL, small_problem, upright
from tests.excitation.problems import PROBLEMS, inside

ROOM = 1e-3


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


def largest(problem, x):
    """Largest value of each row, in size where it is bounded from both sides, (R,)."""
    values = problem.limited(x)
    return np.max(np.where(problem.two_sided[:, None], np.abs(values), values), axis=1)


@pytest.mark.parametrize("name", PROBLEMS)
def test_a_motion_a_little_beyond_its_limits_comes_inside_and_keeps_more_than_one_that_is_shrunk(name):
    problem = PROBLEMS[name]
    x = minimise(problem, inside(problem), Schedule(steps=30)).x
    tight = replace(problem, bounds=0.97 * problem.bounds * np.max(largest(problem, x) / problem.bounds))
    assert not tight.inside(x)
    moved = moved_inside(tight, x, ROOM)
    assert moved is not None
    assert np.all(largest(tight, moved) < tight.bounds - ROOM)
    shrunk = shrunk_inside(tight, x, ROOM, 0.998)
    costs = [np.inf if each is None else tight.sharpened(1.0).at(each).cost for each in (moved, shrunk)]
    assert costs[0] < costs[1]
    # What is inside stays as it is.
    assert moved_inside(tight, moved, ROOM) is moved


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 2])
def test_a_motion_too_near_to_a_box_is_moved_off_it_where_shrinking_leads_through_it(tmp_path, seed):
    """A design for seven joints beside a box was shrunk to a tenth and searched again at each correction."""
    model = build_model(upright(tmp_path, "", "", BALL), "basic")
    box = ((0.8, 0.0, -0.55), (0.4, 0.4, 0.4))
    problem = small_problem(model, lengths=((4.0, 4),), clearance=0.1, boxes=[box])
    found = minimise(problem, inside(problem, seed))
    assert problem.limited(found.x)[-1].max() > 0.99
    # The distance comes last: 5 mm more of it.
    tight = replace(problem, bounds=np.append(problem.bounds[:-1], 0.9 * problem.bounds[-1]))
    assert shrunk_inside(tight, found.x, ROOM, 0.998) is None
    moved = moved_inside(tight, found.x, ROOM)
    assert moved is not None
    assert tight.inside(moved)
    assert np.linalg.norm(moved - found.x) < 0.02 * np.linalg.norm(found.x)
    assert tight.sharpened(1.0).at(moved).cost < found.cost + 0.3


def test_a_motion_that_cannot_be_brought_inside_is_none():
    problem = PROBLEMS["logdet"]
    assert (
        moved_inside(replace(problem, bounds=np.full(len(problem.bounds), 0.5 * ROOM)), inside(problem), ROOM) is None
    )
