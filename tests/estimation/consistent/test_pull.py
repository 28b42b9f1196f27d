from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from scara_ident.estimation.consistent.options import ConsistentOptions
from scara_ident.estimation.consistent.pull import prior_rows
from scara_ident.estimation.consistent.unknowns import build_unknowns
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot

U = build_unknowns(build_model(load_robot(), "complete"), ConsistentOptions())


@settings(deadline=None, max_examples=25)
@given(st.integers(0, 100_000), st.floats(0.0, 5.0))
def test_a_determined_direction_is_moved_by_less_than_a_tenth_of_its_std(seed, wrong):
    """Directions that the data determine better than to nominal size, or tell from nominal, however wrong it is."""
    rng = np.random.default_rng(seed)
    bodies, others = 11 * U.n, U.size - 11 * U.n
    # Friction and offsets are known well; their scale is their own and does not mix with the bodies'.
    directions = np.eye(U.size)
    directions[:bodies, :bodies] = np.linalg.qr(rng.standard_normal((bodies, bodies)))[0]
    std = np.concatenate([np.geomspace(1e-3, 1e3, bodies), np.full(others, 1e-3)])
    rows = (directions / std).T
    # The data ask for an arm that differs from nominal by up to a hundred thousand times, within their noise.
    truth = U.reference + 10.0**wrong * rng.standard_normal(U.size)
    target = rows @ truth + rng.standard_normal(U.size)
    prior = prior_rows(U, rows, target, 0.01)
    without = np.linalg.solve(rows, target)
    stacked = np.vstack([rows, prior])
    with_prior = np.linalg.lstsq(stacked, np.concatenate([target, prior @ U.reference]), rcond=None)[0]
    moved = np.abs(directions.T @ (with_prior - without)) / std
    apart = np.abs(directions.T @ (without - U.reference)) / std
    determined = (std < 1.0) | (apart > 4.0)
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
