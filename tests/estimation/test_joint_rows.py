"""Rows in blocks of time: grouped and joined they say what they said apart."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.estimation.information import merge
from scara_ident.estimation.joint_rows import BLOCKS_AT_ONCE, JointRows, block_products, joined

COLUMNS = np.array([0, 2, 3])


def rows(seed: int, blocks: int = 7, length: int = 3) -> JointRows:
    table = np.random.default_rng(seed).standard_normal((4, blocks * length))
    return JointRows(COLUMNS, table, np.arange(blocks + 1) * length, np.full(blocks, 10.0 * length))


def gram(item: JointRows, parameters: int = 5) -> np.ndarray:
    factor = item.information(parameters).factor
    return factor.T @ factor


@pytest.mark.parametrize("size", [1, 2, 3, 9])
def test_grouped_blocks_keep_products_counts_and_number_of_rows_and_no_more_rows_than_columns(size):
    item = rows(0)
    once = item.grouped(size)
    assert once.starts[-1] == once.table.shape[1] <= len(once.counts) * len(item.table)
    assert len(once.counts) == -(-7 // size)
    assert (once.samples, once.independent) == (item.samples, item.independent) == (210.0, 21.0)
    assert gram(once) == pytest.approx(gram(item), rel=1e-12, abs=1e-12)
    for block in range(len(once.counts)):
        apart = item.information(5, slice(block * size, (block + 1) * size))
        factor = once.information(5, slice(block, block + 1))
        assert factor.rows == apart.rows
        assert factor.residual_sum(np.ones(5)) == pytest.approx(apart.residual_sum(np.ones(5)), rel=1e-12)


def test_what_is_grouped_again_was_never_apart():
    once, twice = rows(1).grouped(4), rows(1).grouped(2).grouped(2)
    assert np.array_equal(once.counts, twice.counts)
    assert np.array_equal(once.sizes, twice.sizes)
    assert gram(once) == pytest.approx(gram(twice), rel=1e-12, abs=1e-12)
    assert once.part(np.array([1])).independent == once.faded(np.ones(2)).part(np.array([1])).independent == 9.0


def test_joined_rows_stand_one_after_the_other_with_their_owners():
    first, second = rows(2), rows(3).grouped(3)
    (both,), owner = joined([[first], [second]], [COLUMNS])
    assert owner.tolist() == [0] * 7 + [1] * 3
    assert both.independent == 42.0
    whole = merge([first.information(5), second.information(5)])
    assert gram(both) == pytest.approx(whole.factor.T @ whole.factor, rel=1e-12, abs=1e-12)
    (none,), nobody = joined([], [COLUMNS])
    assert none.table.shape == (4, 0)
    assert len(nobody) == none.samples == 0


def test_products_of_blocks_of_any_length_are_those_of_each_alone():
    rng = np.random.default_rng(3)
    bounds = np.cumsum([0, 4, 0, 1, *rng.integers(0, 7, BLOCKS_AT_ONCE)])
    signals = rng.standard_normal((3, bounds[-1]))
    found = block_products(signals, bounds)
    for place, (start, stop) in enumerate(zip(bounds[:-1], bounds[1:], strict=True)):
        own = signals[:, start:stop]
        assert found[place] == pytest.approx(own @ own.T, rel=1e-12, abs=1e-12)
    assert block_products(signals[:, :0], np.array([0])).shape == (0, 3, 3)


def test_consecutive_blocks_are_the_same_memory_and_others_keep_their_order():
    item = rows(1)
    assert np.shares_memory(item.part(np.array([2, 3, 4])).table, item.table)
    found = item.part(np.array([5, 0, 1, 3]))
    assert np.array_equal(found.table, item.table[:, [15, 16, 17, 0, 1, 2, 3, 4, 5, 9, 10, 11]])
    assert found.starts.tolist() == [0, 3, 6, 9, 12]
    assert item.part(np.zeros(0, dtype=np.intp)).table.shape == (4, 0)


def test_what_parameters_leave_is_the_torque_less_their_columns_and_is_summed_block_by_block():
    item, value = rows(5), np.array([1.0, 9.0, -2.0, 0.5, 9.0])
    item = JointRows(COLUMNS, item.table, np.array([0, 3, 3, 20, 21]), np.ones(4))
    a, b, c, torque = item.table
    left = item.left(value)
    assert left == pytest.approx(torque - a + 2.0 * b - 0.5 * c)
    assert item.rms(value) == pytest.approx(np.sqrt(np.sum(left**2) / 4.0))
    expected = [np.sum(left[:3]), 0.0, np.sum(left[3:20]), left[20]]
    assert item.by_block(left) == pytest.approx(np.array(expected))
