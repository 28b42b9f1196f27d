"""What pulls, pushes and bends belongs together."""

import numpy as np
import pytest

from tests.excitation.problems import PROBLEMS, inside


@pytest.mark.parametrize("name", ["two, with a prior", "six joints"])
def test_pull_and_curvature_belong_to_push(name):
    problem = PROBLEMS[name]
    x = inside(problem)
    slopes = problem.slopes(problem.at(x))
    rng = np.random.default_rng(6)
    u = rng.standard_normal(slopes.values.shape)
    dx = rng.standard_normal((len(x), x[0].size))
    pushed = slopes.push(dx)
    assert np.sum(slopes.pull(u) * dx) == pytest.approx(np.sum(u * pushed), rel=1e-10)
    bent = np.einsum("kx,kxy,ky->", dx, slopes.curvature(u**2), dx)
    assert bent == pytest.approx(np.sum(u**2 * pushed**2), rel=1e-10)
