"""Settings that mean nothing are refused, and blocks are counted in whole rows where there is a band."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.errors import UsageError
from scara_ident.online import OnlineSettings

SETTINGS = OnlineSettings(rate=500.0, block=32, memory=60.0)


@pytest.mark.parametrize(
    "change",
    [
        {"rate": 0.0},
        {"block": 1.5},
        {"forgetting": "slow"},
        {"renewal": 2.0},
        {"false_alarms": -1.0},
        {"band": 0.0},
        {"band": 50.1},
        {"band": np.nan},
    ],
)
def test_settings_that_mean_nothing_are_refused(change):
    with pytest.raises(UsageError, match=f"online: {next(iter(change))}"):
        replace(SETTINGS, **change)


def test_a_band_says_how_high_it_may_be():
    with pytest.raises(
        UsageError, match=r"band is 80.0 at 500 samples/s; expected a frequency above 0 and up to 50 Hz"
    ):
        replace(SETTINGS, band=80.0)


def test_without_a_band_a_block_is_as_given():
    assert SETTINGS.row_filter is None and SETTINGS.new == 32
    np.testing.assert_allclose(SETTINGS.share, 32.0 / 250.0)
    np.testing.assert_allclose(SETTINGS.blocks_between, 3600.0 * 500.0 / 32.0 / 0.01)
    np.testing.assert_allclose(SETTINGS.keep, np.exp(-32.0 / 500.0 / 60.0))


def test_with_a_band_a_block_is_four_rows_or_as_many_as_fill_it():
    # Rows of a band of 12.5 Hz are 20 samples apart.
    assert replace(SETTINGS, band=12.5).new == 80
    assert replace(SETTINGS, band=12.5, block=90).new == 100
    few = replace(SETTINGS, band=12.5)
    np.testing.assert_allclose(few.share, 80.0 / 250.0)
    np.testing.assert_allclose(few.blocks_between, 3600.0 * 500.0 / 80.0 / 0.01)
    np.testing.assert_allclose(few.keep, np.exp(-0.16 / 60.0))
