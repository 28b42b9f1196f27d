"""The cluster test: its level from six blocks to hundreds, and the freedom of columns that live in few of them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy import stats
from scipy.signal import lfilter

from scara_ident.diagnosis.testing.candidate_tests import examine
from scara_ident.diagnosis.testing.cluster_test import min_sizes, needed, significance
from scara_ident.diagnosis.testing.fitted_model import FittedModel, products_of
from scara_ident.estimation.joint_rows import JointRows

pytestmark = pytest.mark.slow

ROWS = 13


def slow(rng: np.random.Generator, count: int, length: int, memory: float) -> np.ndarray:
    return lfilter([1.0], [1.0, -np.exp(-1.0 / memory)], rng.standard_normal((count, length + 200)), axis=1)[:, 200:]


def model_of(columns: np.ndarray, torque: np.ndarray, blocks: int) -> FittedModel:
    starts = np.arange(0, len(torque) + 1, ROWS)
    rows = JointRows(np.arange(len(columns)), np.vstack([columns, torque]), starts, np.full(blocks, float(ROWS)))
    owner = np.arange(blocks) * max(1, blocks // 20) // blocks
    return FittedModel((rows,), len(columns), owner, np.arange(blocks) * 4 // blocks, np.ones(1))


def p_values(rng: np.random.Generator, blocks: int, parameters: int, memory: float, width: int) -> list[float]:
    length = blocks * ROWS
    columns = np.vstack([slow(rng, parameters - 1, length, 8.0), np.ones(length)])
    noise = slow(rng, 1, length, memory)[0] * (1.0 + 0.8 * np.sin(np.arange(length) * 2.0 * np.pi / (3 * ROWS)))
    tried = slow(rng, 20 * width, length, 8.0).reshape(20, width, length)
    model = model_of(columns, noise, blocks)
    return [item.p_value for item in examine(model, [{0: item} for item in tried])]


@pytest.mark.parametrize(("blocks", "repeats"), [(6, 150), (12, 150), (50, 100), (300, 40)])
@pytest.mark.parametrize("parameters", [4, 15])
def test_with_nothing_there_one_in_a_hundred_is_significant_at_one_in_a_hundred(
    blocks: int, repeats: int, parameters: int
):
    # Noise with a memory of a fifth of a block, of a size that comes and goes.
    rng = np.random.default_rng(blocks + parameters)
    found = np.concatenate([p_values(rng, blocks, parameters, 2.5, 1) for _ in range(repeats)])
    # Candidates tried on one noise are alike, so that the level is known to a factor only.
    assert 0.002 <= np.mean(found < 0.01) <= 0.03
    assert np.mean(found < 0.2) == pytest.approx(0.2, abs=0.08)


def test_of_several_coefficients_no_more_are_significant():
    rng = np.random.default_rng(3)
    found = np.concatenate([p_values(rng, 50, 8, 2.5, 2) for _ in range(100)])
    assert np.mean(found < 0.01) <= 0.03


def test_few_blocks_with_many_parameters_have_power():
    # Nine blocks and 58 parameters, a candidate that removes nine tenths of the residual.
    rng = np.random.default_rng(5)
    blocks, rows = 9, 120
    length = blocks * rows
    columns = slow(rng, 58, length, 8.0)
    tried = slow(rng, 1, length, 8.0)
    tried /= np.std(tried)
    torque = 3.0 * tried[0] + rng.standard_normal(length)
    starts = np.arange(0, length + 1, rows)
    table = JointRows(np.arange(58), np.vstack([columns, torque]), starts, np.full(blocks, float(rows)))
    model = FittedModel((table,), 58, np.zeros(blocks, dtype=int), np.arange(blocks) * 4 // blocks, np.ones(1))
    (found,) = examine(model, [{0: tried}])
    assert found.gain > 0.8
    assert found.p_value < 1e-5


def test_a_column_that_lives_in_two_blocks_has_next_to_no_freedom():
    rng = np.random.default_rng(7)
    blocks = 60
    length = blocks * ROWS
    columns, noise = slow(rng, 3, length, 8.0), rng.standard_normal(length)
    wide, narrow = slow(rng, 2, length, 8.0)
    narrow[2 * ROWS :] = 0.0
    one, other = examine(model_of(columns, noise, blocks), [{0: wide[None]}, {0: narrow[None]}])
    assert one.freedom > 15.0
    assert other.freedom < 3.0


def test_a_column_of_one_block_cannot_be_tested():
    rng = np.random.default_rng(8)
    blocks = 30
    length = blocks * ROWS
    only = np.zeros(length)
    only[5 * ROWS : 6 * ROWS] = rng.standard_normal(ROWS)
    torque = 10.0 * only + rng.standard_normal(length)
    (found,) = examine(
        model_of(slow(rng, 3, length, 8.0) * 0.0 + 1e-3 * np.arange(length), torque, blocks), [{0: only[None]}]
    )
    assert found.p_value == 1.0
    # Its covariance is rounding; with freedom it would promise that next to nothing is seen.
    assert found.freedom == 0.0


def test_significance_is_students_and_hotellings():
    one, both = np.eye(1), np.array([[2.0, 0.3], [0.3, 1.0]])
    assert significance(np.array([3.0]), np.array([[4.0]]), 7.0, one) == pytest.approx(2.0 * stats.t.sf(1.5, 7.0))
    value, covariance = np.array([1.0, 2.0]), np.array([[0.3, 0.1], [0.1, 0.5]])
    wald = value @ np.linalg.solve(covariance, value)
    assert significance(value, covariance, 12.0, both) == pytest.approx(stats.f.sf(wald * 11.0 / 24.0, 2, 11.0))
    # Units change nothing.
    scale, inverse = np.array([1e6, 1e-6]), np.array([1e-6, 1e6])
    assert_allclose(
        significance(value * scale, covariance * np.outer(scale, scale), 12.0, both * np.outer(inverse, inverse)),
        significance(value, covariance, 12.0, both),
    )
    assert significance(value, np.full((2, 2), np.inf), 12.0, both) == 1.0


def test_many_columns_with_little_freedom_are_tested_one_by_one():
    # Twice, for together they were asked as well.
    value, covariance = np.array([0.1, 30.0, 0.1]), np.diag([1.0, 4.0, 1.0])
    assert significance(value, covariance, 3.0, np.eye(3)) == pytest.approx(2.0 * 3.0 * 2.0 * stats.t.sf(15.0, 3.0))


def test_of_many_coefficients_in_few_blocks_no_more_are_significant():
    rng = np.random.default_rng(4)
    found = np.concatenate([p_values(rng, 12, 4, 2.5, 8) for _ in range(60)])
    assert np.mean(found < 0.01) <= 0.03


@pytest.mark.parametrize(("count", "freedom"), [(1, 4.0), (4, 4.5), (4, 2.5), (3, 60.0)])
def test_as_many_standard_errors_as_are_needed_have_the_chance_asked_for(count: int, freedom: float):
    value = np.zeros(count)
    value[0] = needed(count, freedom, 1e-4)
    assert significance(value, np.eye(count), freedom, np.eye(count)) == pytest.approx(1e-4, rel=0.01)


def test_a_column_of_which_rounding_leaves_less_than_nothing_is_not_tested():
    assert significance(np.ones(1), np.eye(1), 9.0, np.array([[-1e-25]])) == 1.0


def test_a_column_of_next_to_nothing_is_none():
    """Its squares are the smallest numbers that there are, as where a ripple's or a Stribeck's decay leaves them."""
    rng = np.random.default_rng(9)
    model = model_of(slow(rng, 4, 20 * ROWS, 8.0), rng.standard_normal(20 * ROWS), 20)
    tried = np.zeros((1, 20 * ROWS))
    tried[0, 3 * ROWS : 9 * ROWS] = 1e-160 * rng.standard_normal(6 * ROWS)
    (item,) = examine(model, [{0: tried}])
    assert item.p_value == 1.0


def test_columns_that_the_model_holds_but_for_rounding_have_no_share_below_zero():
    """What rounding leaves of them in a block may be less than nothing; a root of it is a warning, which fails here."""
    told = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        columns = slow(rng, 4, 6 * ROWS, 8.0)
        model = model_of(columns, rng.standard_normal(6 * ROWS), 6)
        tried = rng.standard_normal((2, 4)) @ columns
        tried[:, : 2 * ROWS] += 1e-7 * rng.standard_normal((2, 2 * ROWS))
        told += [min_sizes(model, products_of(model, [{0: tried}]), 1e-4)[0]]
    assert np.all(np.array(told) > 0.0)
