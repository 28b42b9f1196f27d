"""Intervals hold the truth as often as they say, whatever power of a parameter is what the data tell."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.effects.symmetric_power import changed, interval

DRAWS = 20000


def test_ends_of_a_compliance_are_those_of_the_stiffness():
    compliance, std = 1.0 / 3845.0, 1504.0 / 3845.0**2
    low, high = interval(3845.0, 1504.0, -1.0)
    assert (low, high) == pytest.approx((1.0 / (compliance + 2.0 * std), 1.0 / (compliance - 2.0 * std)))


def test_where_a_compliance_may_be_none_a_stiffness_has_no_upper_end():
    assert interval(3845.0, 2000.0, -1.0) == (pytest.approx(3845.0**2 / (3845.0 + 4000.0)), np.inf)
    # However little is known, so compliant it is at most.
    assert interval(1e6, 1e9, -1.0) == (pytest.approx(500.0, rel=1e-3), np.inf)


def test_what_may_be_anything_has_no_ends():
    assert interval(0.01, 0.1, 0.0) == (-np.inf, np.inf)
    assert interval(0.01, 1e4, 1e-12) == (-np.inf, np.inf)
    assert interval(5.0, 20.0, 0.5) == (-np.inf, pytest.approx(5.0 * 5.0**2))


@pytest.mark.parametrize("power", [-2.0, -1.0, 0.0])
def test_where_the_standard_deviation_is_a_small_share_it_says_all(power: float):
    assert interval(100.0, 2.0, power) is None
    assert interval(100.0, 35.0, power) is not None
    assert interval(100.0, 35.0, 1.0) is None


@pytest.mark.parametrize(
    ("value", "std"), [(np.inf, np.inf), (3.0, np.inf), (3.0, 0.0), (-3.0, 2.0), (0.0, 1.0), (np.nan, 1.0), (1.0, np.nan)]
)  # fmt: skip
def test_what_has_no_size_or_no_standard_deviation_has_no_interval(value: float, std: float):
    assert interval(value, std, -1.0) is None


def test_powers_near_the_logarithm_are_near_it():
    for way in (-3.0, 1.0, 8.0):
        assert changed(2.0, way, 1e-9) == pytest.approx(changed(2.0, way, 0.0))
        assert changed(2.0, way, 0.0) == pytest.approx(2.0 * np.exp(way / 2.0))


def missed(truth: float, value: np.ndarray, std: np.ndarray, power: float) -> tuple[float, float]:
    """Share of draws whose interval ends below the truth, and of those whose begins above it."""
    ends = [interval(v, s, power) or (v - 2.0 * s, v + 2.0 * s) for v, s in zip(value, std, strict=True)]
    low, high = np.array(ends).T
    return float(np.mean(high < truth)), float(np.mean(low > truth))


def test_an_even_compliance_or_logarithm_is_held_95_of_100_times():
    """From the definition: what is told is drawn from a normal distribution, and the parameter made of it."""
    noise = np.random.default_rng(1).standard_normal(DRAWS)
    compliance, share = 1.0 + 0.25 * noise, 0.4
    stiffness = 1.0 / compliance
    assert missed(1.0, stiffness, 0.25 * stiffness**2, -1.0) == pytest.approx((0.023, 0.023), abs=0.004)
    distance = np.exp(share * noise)
    assert missed(1.0, distance, share * distance, 0.0) == pytest.approx((0.023, 0.023), abs=0.004)
    # Give or take two standard deviations, the stiffness and the distance are missed on one side only.
    assert missed(1.0, stiffness, 0.25 * stiffness**2, 1.0)[0] > 0.06
    assert missed(1.0, distance, share * distance, 1.0)[0] > 0.06


def test_what_is_half_of_one_and_half_of_another_kind_is_missed_evenly_by_a_power_between():
    """A stiffness of an inertia, itself, and of a compliance, its reciprocal, both as unsure."""
    inertia, compliance = 1.0 + 0.2 * np.random.default_rng(2).standard_normal((2, DRAWS))
    value = inertia / compliance
    std = value * np.hypot(0.2 / inertia, 0.2 / compliance)
    below, above = missed(1.0, value, std, 0.0)
    assert max(below, above) < 0.03 and below == pytest.approx(above, abs=0.004)
    assert missed(1.0, value, std, 1.0)[0] > 0.04 and missed(1.0, value, std, -1.0)[1] > 0.04
