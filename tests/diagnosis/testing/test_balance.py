"""Weighted blocks: their algebra against all rows, level and power where one block holds most of a candidate's columns."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from scara_ident.diagnosis.testing.balance import weighted
from scara_ident.diagnosis.testing.candidate_tests import Examination, examine
from scara_ident.diagnosis.testing.fitted_model import products_of
from tests.diagnosis.testing.test_cluster_test import ROWS, model_of, slow

pytestmark = pytest.mark.slow


def in_one_block(rng: np.random.Generator, blocks: int) -> np.ndarray:
    """Columns that move in all blocks, with four fifths of their square in one."""
    size = np.ones(blocks)
    size[rng.integers(blocks)] = 2.0 * np.sqrt(blocks - 1.0)
    return slow(rng, 1, blocks * ROWS, 8.0) * np.repeat(size, ROWS)


def drawn(rng: np.random.Generator, blocks: int, size: float, noise: np.ndarray) -> Examination:
    """Examine such a candidate, of a size in standard errors of least squares beside white noise."""
    columns, tried = slow(rng, 4, blocks * ROWS, 8.0), in_one_block(rng, blocks)
    outside = tried[0] - np.linalg.lstsq(columns.T, tried[0], rcond=None)[0] @ columns
    torque = noise / np.std(noise) + size / np.linalg.norm(outside) * tried[0]
    (found,) = examine(model_of(columns, torque, blocks), [{0: tried}])
    return found


def test_what_follows_from_blocks_is_what_follows_from_all_rows():
    rng = np.random.default_rng(1)
    blocks, k = 12, 2
    length = blocks * ROWS
    model = model_of(slow(rng, 3, length, 8.0), rng.standard_normal(length), blocks)
    tried = slow(rng, k, length, 8.0) * np.repeat(rng.uniform(0.2, 3.0, blocks), ROWS)
    found = products_of(model, [{0: tried}])
    basis, into = model.basis(0).T, np.linalg.inv(np.linalg.cholesky(np.sum(found.columns[0], axis=0))).T
    unit = replace(found, columns=into.T @ found.columns @ into, cross=into.T @ found.cross)
    weights = rng.uniform(0.1, 1.0, (1, blocks))
    result = weighted(model, unit, weights)

    own = (tried.T - basis @ (basis.T @ tried.T)) @ into
    root = np.sqrt(np.repeat(weights[0], ROWS))[:, None]
    spanned = np.linalg.lstsq(root * basis, root * own, rcond=None)[0]
    instruments = np.hstack([basis, root**2 * (own - basis @ spanned)])
    regressors = np.hstack([basis, own])
    inverse = np.linalg.inv(instruments.T @ regressors)
    assert_allclose(result.spread[0], (inverse @ instruments.T @ instruments @ inverse.T)[-k:, -k:], atol=1e-12)
    # What single rows change by leaving a block out: fitted again without it.
    whole, changes = inverse @ instruments.T, []
    for block in range(blocks):
        kept = np.delete(np.arange(length), slice(block * ROWS, (block + 1) * ROWS))
        without = np.zeros((len(inverse), length))
        without[:, kept] = np.linalg.solve(instruments[kept].T @ regressors[kept], instruments[kept].T)
        changes.append((whole - without)[-k:])
    for b, c in ((0, 0), (3, 3), (2, 7), (5, 4)):
        expected = result.links[0, b] * result.signs @ result.links[0, c].T + (b == c) * result.alone[0, b]
        assert_allclose(expected, changes[b] @ changes[c].T, atol=1e-10)


@pytest.mark.parametrize(("blocks", "repeats"), [(6, 200), (12, 300), (50, 150), (300, 40)])
def test_of_noise_no_more_is_significant(blocks: int, repeats: int):
    rng = np.random.default_rng(blocks)
    found = []
    for k in range(repeats):
        length = blocks * ROWS
        # White, with a memory of a fifth of a block, and with heavy tails.
        noise = [rng.standard_normal, lambda n: slow(rng, 1, n, 2.5)[0], lambda n: rng.standard_t(3.0, n)][k % 3](
            length
        )
        found.append(drawn(rng, blocks, 0.0, noise).p_value)
    # Three times the nominal rate is allowed; of so few draws a rate is known to three of its standard errors.
    assert np.mean(np.array(found) < 0.01) <= 0.03
    assert np.mean(np.array(found) < 0.2) <= 0.2 + 3.0 * np.sqrt(0.2 * 0.8 / repeats)


@pytest.mark.parametrize(("blocks", "size", "least"), [(12, 30.0, 0.7), (50, 15.0, 0.7), (300, 12.0, 0.6)])
def test_what_all_blocks_tell_is_seen_beside_one_that_tells_most(blocks: int, size: float, least: float):
    rng = np.random.default_rng(blocks)
    found = [drawn(rng, blocks, size, rng.standard_normal(blocks * ROWS)) for _ in range(40)]
    assert np.mean([item.p_value < 1e-5 for item in found]) >= least
    # The coefficient tested is less sure, and as far off as is said.
    off = [(item.tested[0] - size / np.sqrt(item.products[0, 0])) / np.sqrt(item.covariance[0, 0]) for item in found]
    assert 0.5 <= np.sqrt(np.median(np.square(off))) / 0.6745 <= 1.6


def test_what_the_block_and_the_others_say_against_each_other_is_not_significant():
    rng = np.random.default_rng(2)
    blocks = 50
    tried = in_one_block(rng, blocks)
    most = np.repeat(np.sum(tried.reshape(blocks, ROWS) ** 2, axis=1), ROWS)
    noise = rng.standard_normal(blocks * ROWS)
    torque = noise + np.where(most == np.max(most), 3.0, -3.0) * tried[0]
    (found,) = examine(model_of(slow(rng, 4, blocks * ROWS, 8.0), torque, blocks), [{0: tried}])
    assert found.value[0] > 0.0
    assert found.p_value > 1e-5


def test_where_no_block_holds_more_than_all_others_none_is_weighted():
    rng = np.random.default_rng(4)
    blocks = 20
    length = blocks * ROWS
    columns, tried = slow(rng, 4, length, 8.0), slow(rng, 1, length, 8.0)
    noise = rng.standard_normal(length)
    for size, weighs in ((3.5, False), (20.0, True)):
        # A block of a third of the square, which leaves four degrees of freedom, and one of five sixths.
        own = tried * np.repeat(np.where(np.arange(blocks) == 3, size, 1.0), ROWS)
        (found,) = examine(model_of(columns, noise, blocks), [{0: own}])
        assert (not np.array_equal(found.tested, found.value)) is weighs
