"""A filter by its frequency response against the same filter in time."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import bilinear, freqz, lfilter

from scara_ident.motion.transfer import through

RATE, TIME_CONSTANT = 500.0, 0.02
UP, DOWN = bilinear([1.0], [TIME_CONSTANT, 1.0], RATE)


def response(omega):
    return freqz(UP, DOWN, omega)[1]


def test_a_filter_is_that_of_scipy_where_it_has_forgotten_the_beginning():
    rng = np.random.default_rng(0)
    signal = np.cumsum(rng.standard_normal((3, 2, 2001)), axis=-1)
    moved, chord, slope = through(signal, response, 100)
    # At rest its gain is 1 and its delay the time constant.
    found = moved + chord - slope * TIME_CONSTANT * RATE
    expected = lfilter(UP, DOWN, signal, axis=-1)
    inside = slice(200, None)
    assert found[..., inside] == pytest.approx(expected[..., inside], abs=1e-3 * np.ptp(signal))
    assert found.shape == signal.shape


@pytest.mark.parametrize("count", [4, 5, 300])
def test_a_straight_line_is_its_own_chord(count: int):
    line = 3.0 - 0.5 * np.arange(count)
    moved, chord, slope = through(line, response, 100)
    assert np.max(np.abs(moved)) < 1e-9
    assert chord == pytest.approx(line)
    assert slope == pytest.approx(np.array([-0.5]))


def test_nothing_is_changed_by_a_gain_of_one():
    signal = np.random.default_rng(1).standard_normal(257)
    moved, chord, _ = through(signal, np.ones_like, 64)
    assert moved + chord == pytest.approx(signal)


@pytest.mark.parametrize("count", [6001, 8101])
def test_a_length_that_transforms_slowly_is_filtered_as_any_other(count: int):
    """12391 samples, a prime number, took eleven times as long."""
    rng = np.random.default_rng(3)
    signal = np.cumsum(rng.standard_normal((2, count)), axis=-1)
    moved, chord, slope = through(signal, response, 100)
    found = moved + chord - slope * TIME_CONSTANT * RATE
    assert found[..., 200:] == pytest.approx(lfilter(UP, DOWN, signal, axis=-1)[..., 200:], abs=1e-3 * np.ptp(signal))
