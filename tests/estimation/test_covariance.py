"""Reported standard deviations against the spread of estimates, on synthetic linear recordings."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lfilter

from scara_ident.estimation.covariance import block_covariance
from scara_ident.estimation.information import Information, merge

Block = tuple[Information, ...]


def white(rng: np.random.Generator, count: int) -> np.ndarray:
    return rng.standard_normal(count)


def coloured(rng: np.random.Generator, count: int) -> np.ndarray:
    """First-order autoregression with a memory of 10 samples, unit variance."""
    a = 0.9
    return lfilter([np.sqrt(1 - a**2)], [1.0, -a], rng.standard_normal(count + 200))[200:]


def smooth_columns(rng: np.random.Generator, count: int, p: int) -> np.ndarray:
    """Columns as motion makes them: slow sines, so that correlated noise matters."""
    time = np.arange(count)
    return np.column_stack(
        [np.sin(2 * np.pi * time * rng.uniform(0.002, 0.008) + rng.uniform(0, 6)) for _ in range(p - 1)]
        + [np.ones(count)]
    )


def blocks_of(w: np.ndarray, u: np.ndarray, length: int) -> list[Block]:
    bounds = np.arange(0, len(u) + 1, length)
    return [(Information.empty(w.shape[1]).absorb(w[a:b], u[a:b]),) for a, b in zip(bounds, bounds[1:], strict=False)]


def spread_and_reported(
    noise: Callable[[np.random.Generator, int], np.ndarray], count: int, length: int, draws: int = 150, p: int = 4
) -> tuple[np.ndarray, np.ndarray, str]:
    rng = np.random.default_rng(0)
    w = smooth_columns(rng, count, p)
    values, stds, kind = [], [], ""
    for _ in range(draws):
        u = w @ np.arange(1.0, p + 1) + 0.1 * noise(rng, count)
        blocks = blocks_of(w, u, length)
        all_rows = merge(block[0] for block in blocks)
        value = all_rows.solve().value
        found = block_covariance(all_rows.inverse(), value, [blocks])
        values.append(value)
        stds.append(np.sqrt(np.diag(found.matrix)))
        kind = found.kind
        assert found.blocks == len(blocks)
    return np.std(values, axis=0, ddof=1), np.sqrt(np.mean(np.square(stds), axis=0)), kind


@pytest.mark.parametrize("noise", [white, coloured])
def test_the_reported_std_is_the_spread_of_estimates(noise: Callable[..., np.ndarray]):
    spread, reported, kind = spread_and_reported(noise, count=6000, length=150)
    assert kind == "block"
    np.testing.assert_allclose(reported, spread, rtol=0.3)


@pytest.mark.parametrize("noise", [white, coloured])
def test_with_few_blocks_the_pooled_std_is_the_spread(noise: Callable[..., np.ndarray]):
    spread, reported, kind = spread_and_reported(noise, count=1500, length=250)
    assert kind == "pooled block"
    np.testing.assert_allclose(reported, spread, rtol=0.3)


def test_the_textbook_covariance_would_promise_too_much():
    """That the test above is one: for coloured noise the white formula is off by more than its tolerance."""
    rng = np.random.default_rng(0)
    w = smooth_columns(rng, 6000, 4)
    textbook = 0.1 * np.sqrt(np.diag(np.linalg.inv(w.T @ w)))
    spread, _, _ = spread_and_reported(coloured, count=6000, length=150)
    assert np.all(spread > 2.0 * textbook)


def test_several_recordings_count_like_one_and_their_ends_are_not_neighbours():
    rng = np.random.default_rng(2)
    w = smooth_columns(rng, 6000, 3)
    u = w @ np.ones(3) + 0.1 * coloured(rng, 6000)
    blocks = blocks_of(w, u, 150)
    rows = merge(block[0] for block in blocks)
    value, inverse = rows.solve().value, rows.inverse()
    one = block_covariance(inverse, value, [blocks])
    two = block_covariance(inverse, value, [blocks[:20], blocks[20:]])
    swapped = block_covariance(inverse, value, [blocks[20:], blocks[:20]])
    assert two.blocks == one.blocks == 40
    np.testing.assert_allclose(two.matrix, swapped.matrix, rtol=1e-9)
    np.testing.assert_allclose(np.diag(two.matrix), np.diag(one.matrix), rtol=0.3)


@pytest.mark.parametrize("length", [150, 1500])
def test_units_of_parameters_scale_their_std(length: int):
    rng = np.random.default_rng(3)
    w = smooth_columns(rng, 6000, 4)
    u = w @ np.ones(4) + 0.1 * coloured(rng, 6000)
    unit = np.array([1e-4, 1.0, 1e5, 30.0])
    found = []
    for columns in (w, w * unit):
        blocks = blocks_of(columns, u, length)
        rows = merge(block[0] for block in blocks)
        found.append(block_covariance(rows.inverse(), rows.solve().value, [blocks]).matrix)
    np.testing.assert_allclose(found[1] * np.outer(unit, unit), found[0], rtol=1e-6, atol=1e-9 * np.max(found[0]))


@pytest.mark.parametrize("length", [150, 1500])
def test_the_covariance_is_symmetric_and_not_negative(length: int):
    rng = np.random.default_rng(4)
    w = smooth_columns(rng, 6000, 4)
    blocks = blocks_of(w, w @ np.ones(4) + 0.1 * coloured(rng, 6000), length)
    rows = merge(block[0] for block in blocks)
    matrix = block_covariance(rows.inverse(), rows.solve().value, [blocks]).matrix
    np.testing.assert_allclose(matrix, matrix.T, rtol=1e-10)
    assert np.linalg.eigvalsh(matrix)[0] > -1e-14 * np.trace(matrix)


def test_joints_of_different_noise_are_both_honest():
    rng = np.random.default_rng(5)
    w = [smooth_columns(rng, 3000, 2), smooth_columns(rng, 3000, 2)]
    wide = [np.column_stack([w[0], np.zeros((3000, 2))]), np.column_stack([np.zeros((3000, 2)), w[1]])]
    values, pooled = [], []
    for _ in range(120):
        u = [wide[j] @ np.ones(4) + size * rng.standard_normal(3000) for j, size in enumerate((0.01, 1.0))]
        # Six blocks for four parameters: pooled, with one size of noise per joint.
        parts = [blocks_of(wide[j], u[j], 500) for j in (0, 1)]
        blocks = [(a[0], b[0]) for a, b in zip(*parts, strict=True)]
        rows = merge(part for block in blocks for part in block)
        found = block_covariance(rows.inverse(), rows.solve().value, [blocks])
        assert found.kind == "pooled block"
        values.append(rows.solve().value)
        pooled.append(np.diag(found.matrix))
    np.testing.assert_allclose(np.sqrt(np.mean(pooled, axis=0)), np.std(values, axis=0, ddof=1), rtol=0.3)


def test_what_one_block_alone_tells_is_not_reported_as_certain():
    """A parameter whose column lives in one block of forty is as unsure as the noise makes it."""
    values, reported = [], []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        w = smooth_columns(np.random.default_rng(9), 6000, 3)
        w[:, 0] = 0.0
        w[3000:3150, 0] = 1.0
        u = w @ np.ones(3) + 0.1 * white(rng, 6000)
        blocks = blocks_of(w, u, 150)
        rows = merge(block[0] for block in blocks)
        found = block_covariance(rows.inverse(), rows.solve().value, [blocks])
        values.append(rows.solve().value)
        reported.append(np.diag(found.matrix))
    np.testing.assert_allclose(np.sqrt(np.mean(reported, axis=0)), np.std(values, axis=0, ddof=1), rtol=0.3)


def test_a_fit_without_redundancy_is_infinitely_unsure():
    w, u = np.eye(3), np.ones(3)
    blocks = blocks_of(w, u, 3)
    rows = blocks[0][0]
    found = block_covariance(rows.inverse(), rows.solve().value, [blocks])
    assert np.all(np.diag(found.matrix) == np.inf)


def test_what_is_undetermined_does_not_disturb_the_others():
    rng = np.random.default_rng(6)
    w = smooth_columns(rng, 6000, 3)
    u = w @ np.ones(3) + 0.1 * white(rng, 6000)
    wide = np.insert(w, 1, 0.0, axis=1)
    found = []
    for columns in (w, wide):
        blocks = blocks_of(columns, u, 150)
        rows = merge(block[0] for block in blocks)
        found.append(block_covariance(rows.inverse(), rows.solve().value, [blocks]).matrix)
    np.testing.assert_allclose(found[1][np.ix_([0, 2, 3], [0, 2, 3])], found[0], rtol=1e-9)


def test_a_dozen_blocks_are_unbiased():
    """What the correction for leverage is for: without it the std of four parameters would be a tenth too small."""
    spread, reported, kind = spread_and_reported(white, count=1800, length=150, draws=500)
    assert kind == "block"
    np.testing.assert_allclose(np.mean(reported / spread), 1.0, atol=0.05)


def test_noise_that_reaches_into_the_next_block_is_counted():
    """Blocks only three memories long: each by itself would promise a sixth too little."""
    spread, reported, kind = spread_and_reported(coloured, count=1800, length=30, draws=200)
    assert kind == "block"
    np.testing.assert_allclose(np.mean(reported / spread), 1.0, atol=0.08)
