"""The test by rows: power where a column lives in few blocks, and its level on noise with a memory."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.testing.candidate_tests import examine
from scara_ident.diagnosis.testing.cluster_test import significance
from scara_ident.diagnosis.testing.row_test import examine_rows
from scara_ident.effects import Member
from scara_ident.effects.measurement import TorqueSensorNonlinearity
from tests.diagnosis.made import exact_runs, step_beside
from tests.diagnosis.testing.test_cluster_test import ROWS, model_of, slow


def few_places(rng: np.random.Generator, length: int) -> np.ndarray:
    return slow(rng, 1, length, 8.0) ** 3


@pytest.mark.parametrize("blocks", [12, 40])
def test_a_column_of_few_places_that_removes_nearly_all_is_beyond_doubt(blocks: int):
    rng = np.random.default_rng(blocks)
    length = blocks * ROWS
    columns, tried = slow(rng, 5, length, 8.0), few_places(rng, length)
    noise = slow(rng, 1, length, 1.0)[0]
    model = model_of(columns, noise + 20.0 * tried[0] / np.std(tried), blocks)
    (found,) = examine(model, [{0: tried}])
    again = examine_rows(model, {0: tried}, found)
    assert again.p_value < 1e-3 * found.p_value
    assert again.p_value < 1e-8
    assert again.freedom > found.freedom
    # The coefficient is as far off as its covariance says.
    error = found.value - 20.0 / np.std(tried)
    assert abs(error[0]) < 4.0 * np.sqrt(again.covariance[0, 0])


@pytest.mark.slow
@pytest.mark.parametrize("memory", [0.5, 2.5])
def test_of_noise_hardly_any_is_significant(memory: float):
    rng = np.random.default_rng(7)
    blocks = 12
    length = blocks * ROWS
    found = []
    for _ in range(150):
        model = model_of(slow(rng, 4, length, 8.0), slow(rng, 1, length, memory)[0], blocks)
        for tried in (few_places(rng, length), slow(rng, 1, length, 8.0)):
            (item,) = examine(model, [{0: tried}])
            found.append(examine_rows(model, {0: tried}, item).p_value)
    assert np.mean(np.array(found) < 0.01) <= 0.02
    assert np.mean(np.array(found) < 0.001) <= 0.005


def test_rows_are_not_counted_beside_what_is_remembered_over_most_of_a_block():
    rng = np.random.default_rng(5)
    blocks = 12
    length = blocks * ROWS
    tried, missing = few_places(rng, length), slow(rng, 1, length, 8.0)[0]
    model = model_of(slow(rng, 4, length, 8.0), missing + 20.0 * tried[0] / np.std(tried), blocks)
    (item,) = examine(model, [{0: tried}])
    assert item.gain > 0.9
    again = examine_rows(model, {0: tried}, item)
    assert again.p_value == pytest.approx(min(1.0, 2.0 * item.p_value))
    assert again.freedom == item.freedom


def test_of_white_noise_the_covariance_is_that_of_least_squares():
    rng = np.random.default_rng(3)
    blocks = 300
    length = blocks * ROWS
    columns, noise, tried = slow(rng, 3, length, 8.0), rng.standard_normal(length), slow(rng, 2, length, 8.0)
    # So far off that the test by blocks is not the smaller one.
    model = model_of(columns, noise + tried[0], blocks)
    (item,) = examine(model, [{0: tried}])
    by_rows = examine_rows(model, {0: tried}, item)
    every = np.vstack([columns, tried])
    expected = np.linalg.inv(every @ every.T)[3:, 3:]
    assert_allclose(np.diag(by_rows.covariance), np.diag(expected), rtol=0.2)
    assert by_rows.p_value <= 2.0 * significance(item.value, item.covariance, item.freedom, item.products)


def test_the_smaller_of_both_counts_twice():
    rng = np.random.default_rng(4)
    blocks = 30
    tried = slow(rng, 1, blocks * ROWS, 8.0)
    model = model_of(slow(rng, 3, blocks * ROWS, 8.0), rng.standard_normal(blocks * ROWS), blocks)
    (item,) = examine(model, [{0: tried}])
    again = examine_rows(model, {0: tried}, item)
    alone = significance(item.value, again.covariance, again.freedom, item.products)
    assert again.p_value == pytest.approx(min(1.0, 2.0 * min(item.p_value, alone)))


def test_rows_are_asked_only_where_blocks_leave_doubt_of_what_removes_nearly_all():
    step = step_beside(list(exact_runs(1, 1)))
    (decision,) = step.judge([Candidate(TorqueSensorNonlinearity(), Member(1))])
    doubtful, sure = (replace(decision.examination, p_value=p) for p in (0.1, 1e-9))
    assert step.in_doubt(doubtful, 0.95)
    assert not step.in_doubt(doubtful, 0.5)
    assert not step.in_doubt(sure, 0.95)
