from __future__ import annotations

import cvxpy as cp
import numpy as np
import pytest
from numpy.typing import NDArray

from scara_ident.errors import UsageError
from scara_ident.estimation import ConsistentOptions
from scara_ident.estimation.consistent.problem import Problem, _what_to_try, build_unknowns
from scara_ident.estimation.consistent.solution import solve_consistent
from scara_ident.estimation.information import merge
from tests.estimation.consistent.arms import (
    moving,
    observed,
    scara,
    truth,
)

Array = NDArray[np.float64]


def test_the_problem_is_a_parametrised_one_of_one_size_and_repeats():
    model = scara()
    problem = Problem(model)
    assert problem.cvxpy.is_dcp(dpp=True)
    shapes = set()
    for seed, count in enumerate((50, 500, 5000)):
        item = observed(model, moving(model.robot, seed, count, size=0.05), truth(model), 0.3)
        rows = merge(item.by_joint)
        again = solve_consistent(problem, rows)
        fresh = solve_consistent(Problem(model), rows)
        assert again.point is not None
        np.testing.assert_allclose(again.value, fresh.value, atol=1e-6 * np.abs(fresh.value).max())
        shapes.add(problem.cvxpy.get_problem_data(cp.CLARABEL)[0]["A"].shape)
    assert len(shapes) == 1


def test_a_velocity_limit_of_no_joint_is_refused():
    with pytest.raises(UsageError, match="no identified joint"):
        build_unknowns(scara(), ConsistentOptions(speed={"nose": 1.0}))
    with pytest.raises(UsageError, match="friction: 'nose' is no identified joint"):
        build_unknowns(scara(), ConsistentOptions(friction={"nose": "free"}))


def test_what_was_not_given_is_not_said_to_contradict():
    free, held = _what_to_try("PrimalInfeasible", ConsistentOptions()), ConsistentOptions(total_mass=(1.0, 0.1))
    assert "was not solved" in free and "given" not in free and "method wls" in free
    assert "given masses" in _what_to_try("PrimalInfeasible", held)
