import numpy as np
import pytest

from scara_ident.excitation.criteria import BlockLogDet, Condition, LogDet
from scara_ident.excitation.interior_point import Schedule, minimise, shrunk_inside
from scara_ident.excitation.search import _random_motion
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot
from tests.arms import example_urdf
from tests.excitation.made import rigid_model, scara_with_quill, small_problem


def problems():
    scara = build_model(load_robot())
    # Without offset: the weight of a vertical slide is one.
    quill = build_model(scara_with_quill(), "reduced")
    arm = rigid_model(load_robot(example_urdf("ur5_robot.urdf")))
    return {
        "logdet": small_problem(scara, LogDet(), tool_speed=1.5),
        "block": small_problem(scara, BlockLogDet((1, 2, 3))),
        "cond": small_problem(scara, Condition(power=5.0)),
        "two, with a prior": small_problem(scara, LogDet(), trajectories=2, prior=3.0),
        "prismatic": small_problem(quill, LogDet(), tool_acceleration=5.0, floor=0.0),
        "six joints": small_problem(arm, Condition(scaled=True, power=5.0), floor=-0.5),
    }


PROBLEMS = problems()


def inside(problem, seed=0):
    return shrunk_inside(problem, 0.7 * _random_motion(problem.task, np.random.default_rng(seed)))


@pytest.mark.parametrize("name", PROBLEMS)
def test_gradient_and_slopes_are_those_of_differences(name):
    problem = PROBLEMS[name]
    x = inside(problem)
    slopes = problem.slopes(x)
    cost, values = problem.values(x)
    assert slopes.cost == pytest.approx(cost, rel=1e-12)
    np.testing.assert_allclose(slopes.values, values, atol=1e-12)
    rng = np.random.default_rng(5)
    for _ in range(4):
        direction = rng.standard_normal(x.shape) * np.abs(x).max() * 1e-4
        moved = {k: problem.values(x + k * direction) for k in (-3, -2, -1, 1, 2, 3)}
        weights = {1: 3 / 4, 2: -3 / 20, 3: 1 / 60}
        slope = sum(w * (moved[k][0] - moved[-k][0]) for k, w in weights.items())
        change = sum(w * (moved[k][1] - moved[-k][1]) for k, w in weights.items())
        foreseen = np.sum(slopes.gradient.reshape(x.shape) * direction)
        size = np.linalg.norm(slopes.gradient) * np.linalg.norm(direction)
        assert slope == pytest.approx(foreseen, abs=1e-6 * size)
        pushed = slopes.push(direction.reshape(len(x), -1))
        np.testing.assert_allclose(pushed, change, atol=1e-7 * np.abs(pushed).max())


@pytest.mark.parametrize("name", ["two, with a prior", "six joints"])
def test_pull_and_curvature_belong_to_push(name):
    problem = PROBLEMS[name]
    x = inside(problem)
    slopes = problem.slopes(x)
    rng = np.random.default_rng(6)
    u = rng.standard_normal(slopes.values.shape)
    dx = rng.standard_normal((len(x), x[0].size))
    pushed = slopes.push(dx)
    assert np.sum(slopes.pull(u) * dx) == pytest.approx(np.sum(u * pushed), rel=1e-10)
    bent = np.einsum("kx,kxy,ky->", dx, slopes.curvature(u**2), dx)
    assert bent == pytest.approx(np.sum(u**2 * pushed**2), rel=1e-10)


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
