"""Rows within a band: what is filtered, kept, left out and cut into blocks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from scara_ident.motion.motion import low_pass, low_pass_every, stretches
from scara_ident.motion.prepared import (
    BLOCK_SECONDS,
    active_rows,
    band_blocks,
    fading,
    position_cuts,
    raw_rows,
    row_step,
    rows_of,
    standstill,
    trim_of,
)
from tests.diagnosis.made import BANDS, RATE, complete, exact_runs

MODEL = complete()


@settings(deadline=None, max_examples=25)
@given(
    count=st.integers(200, 3000),
    cut=st.floats(4.0, 30.0),
    step=st.integers(1, 8),
    seed=st.integers(0, 2**16),
)
def test_the_low_pass_at_kept_samples_is_the_low_pass(count: int, cut: float, step: int, seed: int):
    rate = 500.0
    # A stretch shorter than the filter's memory is continued by a guess, which depends on the padding.
    assume(count * cut / rate > 6.0)
    step = min(step, row_step(rate, cut))
    walk = np.cumsum(np.random.default_rng(seed).standard_normal((2, count)), axis=1)
    whole = low_pass(walk, rate, cut)[:, ::step]
    kept = low_pass_every(walk, rate, cut, step)
    assert kept.shape == whole.shape
    assert_allclose(kept, whole, rtol=0, atol=3e-6 * np.ptp(walk))
    inner = slice(len(kept[0]) // 4, -(len(kept[0]) // 4))
    assert_allclose(kept[:, inner], whole[:, inner], rtol=0, atol=1e-7 * np.ptp(walk))


def test_without_a_band_every_sample_is_itself():
    signal = np.arange(20.0)[None]
    assert_array_equal(low_pass_every(signal, 100.0, None, 3), signal[:, ::3])


@pytest.fixture(scope="module")
def stretch():
    (part,) = stretches(exact_runs()[0])
    return part


def test_banded_rows_are_the_low_pass_of_raw_ones(stretch):
    rows = rows_of(MODEL, stretch, BANDS)
    motion, raw = raw_rows(MODEL, stretch, BANDS)
    for j, active in enumerate(active_rows(MODEL)):
        assert_array_equal(rows.raw[j], raw[j])
        faded = fading(rows.rest, RATE, BANDS)[j] * raw[j][active]
        assert_allclose(rows.banded[j][active], low_pass(faded, RATE, BANDS[j]), atol=1e-12)
        idle = np.setdiff1d(np.arange(len(raw[j])), active)
        assert not np.any(raw[j][idle])
        assert not np.any(rows.banded[j][idle])
    assert_array_equal(motion.q, rows.motion.q)
    assert_array_equal(raw[1][-1], exact_runs()[0].effort[1])


def test_blocks_hold_the_kept_samples_once_and_weighted(stretch):
    motion, raw = raw_rows(MODEL, stretch, BANDS)
    rest = standstill(stretch, motion, BANDS)
    blocks = band_blocks(MODEL, stretch, raw, rest, BANDS)
    banded = rows_of(MODEL, stretch, BANDS).banded
    trim, step = trim_of(stretch, BANDS), row_step(RATE, BANDS[0])
    for j in range(2):
        places = np.arange(0, len(stretch.time), step)
        places = places[(places >= trim) & (places < len(stretch.time) - trim) & ~rest[j][places]]
        table = np.vstack([block[j] for block in blocks])
        assert len(table) == len(places)
        assert_allclose(table, np.sqrt(step) * banded[j][:, places].T, atol=1e-6 * np.max(np.abs(banded[j])))
    lengths = [len(block[0]) * step / RATE for block in blocks]
    assert max(lengths) < 2.0 * BLOCK_SECONDS
    assert len(blocks) > 10


def test_a_mask_leaves_out_rows_of_its_joint_only(stretch):
    _, raw = raw_rows(MODEL, stretch, BANDS)
    rest = np.zeros((2, len(stretch.time)), dtype=bool)
    full = band_blocks(MODEL, stretch, raw, rest, BANDS)
    rest[0, 1000:2000] = True
    part = band_blocks(MODEL, stretch, raw, rest, BANDS)
    count = [[sum(len(block[j]) for block in blocks) for j in range(2)] for blocks in (full, part)]
    assert count[0][0] - count[1][0] == pytest.approx(1000 / row_step(RATE, BANDS[0]), abs=1)
    assert count[0][1] == count[1][1]


def test_a_joint_that_stops_is_left_out_there_and_no_more():
    run = exact_runs()[0]
    position = run.position.copy()
    position[1, 1000:1500] = position[1, 1000]
    position[1, 1500:] += position[1, 1000] - position[1, 1500]
    (part,) = stretches(replace(run, position=position))
    motion, _ = raw_rows(MODEL, part, BANDS)
    rest = standstill(part, motion, BANDS)
    assert rest[1, 1050:1450].all()
    assert rest[1].mean() < 0.35
    assert not rest[0, 1050:1450].all()


def test_the_weight_is_zero_at_rest_one_away_from_it_and_has_no_step():
    rest = np.zeros((2, 2000), dtype=bool)
    rest[0, 700:800] = rest[0, 1000:1001] = rest[0, :5] = True
    weight = fading(rest, RATE, (10.0, None))
    assert np.all(weight[0][rest[0]] == 0.0)
    assert np.all((weight[0][~rest[0]] > 0.0) & (weight[0][~rest[0]] <= 1.0))
    ramp = RATE / (3.0 * 10.0)
    assert weight[0][int(800 + ramp) + 1] == 1.0
    assert np.max(np.abs(np.diff(weight[0]))) < 2.0 / ramp
    assert np.all(weight[1] == 1.0)


def test_what_happens_at_rest_does_not_reach_the_rows():
    """A torque that friction takes up at rest, whatever it is, leaves the equation where the joint moves as it was."""
    run = exact_runs()[0]
    (part,) = stretches(run)
    clean = rows_of(MODEL, part, BANDS)
    assert run.effort is not None
    shaken = run.effort + np.where(clean.rest, 5.0, 0.0)
    (other,) = stretches(replace(run, effort=shaken))
    assert np.any(clean.rest)
    for before, after in zip(clean.banded, rows_of(MODEL, other, BANDS).banded, strict=True):
        assert_array_equal(before, after)


def test_positions_pass_a_wider_filter_than_rows_where_the_rate_allows():
    assert position_cuts(1000.0, [10.0, None, 200.0]) == [30.0, None, None]


def test_a_row_stands_for_two_and_a_half_per_period():
    assert row_step(1000.0, 10.0) == 40
    assert row_step(1000.0, None) == 1
    assert row_step(100.0, 90.0) == 1


def test_the_slowest_band_decides_what_is_cut_at_the_ends(stretch):
    assert trim_of(stretch, [None, 5.0]) == 50
    assert trim_of(stretch, [20.0, 5.0]) == 50
    assert trim_of(stretch, [None, None]) == 20
