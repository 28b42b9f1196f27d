"""What the numbers of a column say."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.inspection.values import Reading, averages, slopes, time_unit, velocity_reading
from tests.inspection.made import MADE


@pytest.mark.parametrize(("unit", "factor"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_a_clocks_unit_is_told_by_its_steps(unit, factor):
    assert time_unit(factor * MADE["time"] + 5 * factor) == unit


def test_what_does_not_grow_is_no_clock():
    assert time_unit(np.zeros(100)) is None
    assert time_unit(np.sin(np.arange(100.0))) is None


def test_a_velocity_is_that_of_the_positions_over_the_same_time():
    """Late stamps and the bend of a fast motion are in both; a clock that stands still over a window tells none."""
    time = np.sort(np.arange(600) / 30.0 + np.random.default_rng(0).uniform(0.0, 0.02, 600))
    time = np.concatenate([time[:300], np.full(40, time[299]), time[300:]])
    position, velocity = np.sin(4.0 * time)[None], 4.0 * np.cos(4.0 * time)[None]
    slope, mean = slopes(time, position), averages(time, velocity)
    assert slope.shape == mean.shape
    assert slope.shape[1] == 640 - 20 - 21
    # The trapezium over a step h of 33 ms errs by (4 h)^2 / 12 of the velocity.
    np.testing.assert_allclose(mean, slope, rtol=0.0, atol=0.03)
    gear = np.ones(1)
    assert velocity_reading(slope, mean, gear, linear=False) == Reading("rad/s")
    assert velocity_reading(slope, np.degrees(mean), gear, linear=False) == Reading("deg/s")
    assert velocity_reading(slope, averages(time, np.sin(4.0 * time)[None]), gear, linear=False) is None
