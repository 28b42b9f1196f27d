"""How many samples a row stands for, and how long blocks are."""

from __future__ import annotations

import pytest

from scara_ident.motion.sampling import BLOCK_PERIODS, BLOCK_SECONDS, block_seconds, row_step, samples_per


def test_a_row_stands_for_two_and_a_half_per_period():
    assert row_step(1000.0, 10.0) == 40
    assert row_step(1000.0, None) == 1
    assert row_step(100.0, 90.0) == 1


@pytest.mark.parametrize(
    ("rate", "bands", "samples"),
    [(500.0, (2.5, 3.5), 7), (500.0, (2.5, None), 1), (1000.0, (17.1, 12.0), 2), (100.0, (90.0,), 1)],
)
def test_the_widest_band_says_how_many_samples_one_is_enough_for(
    rate: float, bands: tuple[float | None, ...], samples: int
):
    assert samples_per(rate, bands, 20.0) == samples


def test_a_rate_that_is_a_little_off_makes_no_sample_less():
    assert samples_per(1000.0 * (1.0 - 1e-12), (10.0,), 20.0) == 5


def test_blocks_are_long_against_the_slowest_band():
    assert block_seconds((20.0, None)) == BLOCK_SECONDS
    assert block_seconds((20.0, 2.0)) == BLOCK_PERIODS / 2.0
    assert block_seconds((None, None)) == BLOCK_SECONDS
