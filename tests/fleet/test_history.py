"""An arm over its dates in units of noise, and what differs from date to date."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.estimation.information import UNDETERMINED
from scara_ident.fleet.history import common_removed, scatter, variance_prior


def test_the_scatter_is_that_which_was_put_in_and_a_slope_or_an_odd_arm_hardly_moves_it():
    random = np.random.default_rng(0)
    noise, runs = 0.5, 1.0
    each = []
    for arm in range(40):
        values = runs * random.standard_normal((12, 1)) + noise * random.standard_normal((12, 1))
        values += np.arange(12)[:, None] * (1.5 if arm < 6 else 0.02)
        each.append(np.diff(values, axis=0))
    steps = np.concatenate(each)
    found = scatter(steps, np.full_like(steps, 2.0 * noise**2))
    np.testing.assert_allclose(np.sqrt(found[0]), runs, rtol=0.15)
    assert scatter(0.1 * steps, np.full_like(steps, 2.0 * noise**2))[0] == 0.0
    assert scatter(np.full((3, 1), np.nan), np.ones((3, 1)))[0] == 0.0


def test_variances_tell_each_other_by_what_spread_they_were_drawn_with():
    random = np.random.default_rng(0)
    own, prior, usual = 30.0, 12.0, 2.0
    drawn = usual * prior / random.chisquare(prior, 5000) * random.chisquare(own, 5000) / own
    np.testing.assert_allclose(variance_prior(drawn, own), (prior, usual), rtol=0.1)
    # Those that are all the same are worth as many as there are, or nearly.
    freedom, ratio = variance_prior(random.chisquare(own, 5000) / own, own)
    assert freedom > 20.0 * own
    np.testing.assert_allclose(ratio, 1.0, rtol=0.02)
    assert variance_prior(np.array([1.0, np.nan, 0.0, 3.0]), own) == (0.0, 1.0)


@pytest.mark.slow
def test_whitening_weighs_runs_as_noise(histories):
    row = histories[0].rows[0]
    root = 0.05 * np.random.default_rng(0).standard_normal((row.runs.shape[1], 6))
    white = row.whitened(root)
    cover = np.eye(len(row.torque)) + (row.runs @ root) @ (row.runs @ root).T
    mapped = white.columns.T @ white.columns
    np.testing.assert_allclose(
        mapped, row.columns.T @ np.linalg.solve(cover, row.columns), rtol=1e-6, atol=1e-6 * mapped.max()
    )
    same = row.whitened(np.zeros((row.runs.shape[1], 1)))
    np.testing.assert_array_equal(same.torque, row.torque)


def test_parameters_that_all_dates_share_leave_nothing_of_themselves(histories):
    rows = histories[0].whitened(np.diag(np.tile([0.02, 0.02, 0.0, 0.0, 0.0], 2)))
    left, basis = common_removed(rows)
    stacked = np.concatenate(basis)
    # Rounding over the smallest share of a direction that is told.
    np.testing.assert_allclose(stacked.T @ stacked, np.eye(stacked.shape[1]), atol=1e-16 / UNDETERMINED)
    along = np.concatenate([row.columns for row in rows]).T @ np.concatenate(left)
    size = np.linalg.norm(np.concatenate([row.columns for row in rows]), axis=0)
    assert np.max(np.abs(along) / np.maximum(size, 1e-12)) < 1e-5 * np.linalg.norm(np.concatenate(left))
    # What is left is of the size of the noise.
    assert 0.5 < np.mean(np.concatenate(left) ** 2) < 1.5


def test_days_are_counted_from_the_first_date(histories):
    assert histories[0].days[0] == 0.0 and histories[0].days[1] == 31.0
