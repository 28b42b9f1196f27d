"""What the numbers of a column say."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.inspection.values import Reading, averages, slopes, time_unit, velocity_reading
from tests.inspection.made import MADE


@pytest.mark.parametrize(("unit", "factor"), [("s", 1.0), ("ms", 1e3), ("us", 1e6), ("ns", 1e9)])
def test_a_clocks_unit_is_determined_by_its_steps(unit, factor):
    assert time_unit(factor * MADE["time"] + 5 * factor) == unit


@pytest.mark.parametrize(
    ("rate", "unit", "factor"), [(12.0, "s", 1.0), (6.0, "s", 1.0), (12.0, "ms", 1e3), (3000.0, "s", 1.0)]
)
def test_a_slow_log_is_not_taken_for_one_a_thousand_times_as_fast(rate: float, unit: str, factor: float):
    """Of 270 s at 12 samples a second a first description was written for 0.27 s at 12 kHz."""
    assert time_unit(factor * np.arange(200) / rate) == unit


def test_the_unit_that_a_clocks_name_says_holds_where_its_steps_can_be_such():
    time = 0.125 * np.arange(200.0)
    assert (time_unit(time), time_unit(time, "ms"), time_unit(time, "s")) == ("s", "ms", "s")
    # Steps of 0.125 ns are none of a recording.
    assert time_unit(time, "ns") == "s"


def test_a_joint_that_stands_still_says_nothing_of_the_velocities_unit():
    """The encoder of one that was held flickered by a bit, and the velocities of all were left out as no slopes."""
    random = np.random.default_rng(0)
    slope = np.array([np.sin(np.arange(400) / 20.0), 1e-3 * random.standard_normal(400)])
    velocity = np.array([slope[0], 1e-2 * random.standard_normal(400)])
    assert velocity_reading(slope, velocity, np.ones(2), linear=False) == Reading("rad/s")


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
