from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from scara_ident.consistency.options import ConsistentOptions
from scara_ident.consistency.pull import prior_rows
from scara_ident.consistency.unknowns import build_unknowns
from scara_ident.model import build_model
from scara_ident.robot import load_robot

U = build_unknowns(build_model(load_robot(), "complete"), ConsistentOptions())


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 100_000), st.floats(0.0, 6.0))
def test_a_determined_direction_is_moved_by_less_than_a_tenth_of_its_std(seed, wrong):
    """Directions that the data determine better than to nominal size, or tell from nominal, however wrong it is."""
    rng = np.random.default_rng(seed)
    directions = np.linalg.qr(rng.standard_normal((U.size, U.size)))[0]
    std = np.geomspace(1e-4, 1e4, U.size)
    rows = (directions / std).T
    # The data ask for an arm that differs from nominal by up to a million times, within their noise.
    truth = U.reference + 10.0**wrong * rng.standard_normal(U.size)
    target = rows @ truth + rng.standard_normal(U.size)
    prior = prior_rows(U, rows, target, 0.01)
    without = np.linalg.solve(rows, target)
    normal = rows.T @ rows + prior.T @ prior
    with_prior = np.linalg.solve(normal, rows.T @ target + prior.T @ prior @ U.reference)
    moved = np.abs(directions.T @ (with_prior - without)) / std
    apart = np.abs(directions.T @ (without - U.reference)) / std
    # The random directions mix bodies with other columns, whose own scale is theirs.
    bodies = np.sum(directions[: 11 * U.n] ** 2, axis=0) > 0.0
    determined = bodies & ((std < 1.0) | ((apart > 4.0) & (std < 1e5)))
    assert np.all(moved[determined] < 0.1)


def test_directions_that_the_data_do_not_see_stay_nominal():
    rng = np.random.default_rng(1)
    rows = rng.standard_normal((5, U.size))
    target = rows @ U.reference
    prior = prior_rows(U, rows, target, 0.01)
    normal = rows.T @ rows + prior.T @ prior
    found = np.linalg.solve(normal, rows.T @ target + prior.T @ prior @ U.reference)
    np.testing.assert_allclose(found, U.reference, atol=1e-8)
    assert np.linalg.matrix_rank(prior) == U.size
