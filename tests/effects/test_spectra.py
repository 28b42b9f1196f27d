"""Spectra over motor angle and time against plain least squares, and how often noise alone has a line."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from scara_ident.effects.spectra import (
    GUARD,
    NEIGHBOURS_IN_TIME,
    frequency_spectrum,
    frequency_width,
    lines,
    noise_floor,
    order_spectrum,
    order_width,
    whitened,
)

Array = NDArray[np.float64]

RATE = 1000.0


def motor_angle(seconds: float = 16.0) -> Array:
    """About thirty motor turns there and back."""
    t = np.arange(round(seconds * RATE)) / RATE
    return 100.0 * (1.1 * np.sin(1.3 * t) + 0.4 * np.sin(3.1 * t + 0.5))


def coloured(rng: np.random.Generator, count: int) -> Array:
    """Noise that an autoregression of 20 ms memory gives."""
    from scipy.signal import lfilter

    return np.asarray(lfilter([0.3], [1.0, -0.95], rng.standard_normal(count)))


def test_the_order_spectrum_is_that_of_least_squares():
    rng = np.random.default_rng(0)
    angle = motor_angle()
    residual = rng.standard_normal(len(angle)) + 0.3 * np.sin(2.0 * angle + 1.0) + 0.2
    orders = np.array([0.3, 0.97, 1.0, 2.0, 2.01, 3.7, 7.99, 12.0])
    expected = []
    for order in orders:
        basis = np.column_stack([np.ones_like(angle), np.cos(order * angle), np.sin(order * angle)])
        left = residual - basis @ np.linalg.lstsq(basis, residual, rcond=None)[0]
        expected.append(np.var(residual) - np.mean(left**2))
    found = order_spectrum(residual, angle, orders)
    assert found == pytest.approx(np.array(expected), rel=0.02, abs=2e-6)
    assert found[3] == pytest.approx(0.5 * 0.3**2, rel=0.1)


def test_an_angle_that_does_not_move_has_no_spectrum():
    assert not np.any(order_spectrum(np.ones(10), np.full(10, 0.4), np.array([1.0, 2.0])))


def test_a_frequency_spectrum_shows_a_line_with_any_phases():
    rng = np.random.default_rng(1)
    t = np.arange(8000) / RATE
    parts = [0.2 * np.sin(2.0 * np.pi * 41.3 * t + phase) + rng.standard_normal(len(t)) for phase in (0.0, 2.0, 4.0)]
    width = frequency_width(parts, RATE)
    frequencies = np.arange(1.0, 480.0, width / 4.0)
    power = frequency_spectrum(parts, RATE, frequencies)
    (line,) = lines(frequencies, power, width, degrees=6, neighbours=NEIGHBOURS_IN_TIME)
    assert line.position == pytest.approx(41.3, abs=0.1 * width)
    assert np.sqrt(2.0 * line.power) == pytest.approx(0.2, rel=0.15)


def test_the_order_is_found_between_the_points_and_under_coloured_noise():
    rng = np.random.default_rng(2)
    angle = motor_angle()
    residual = coloured(rng, len(angle)) + 0.15 * np.sin(2.037 * angle + 1.0)
    width = order_width(angle)
    orders = np.arange(0.5, 14.0, width / 4.0)
    first = lines(orders, order_spectrum(whitened([residual], RATE, None)[0][0], angle, orders), width)[0]
    assert first.position == pytest.approx(2.037, abs=0.1 * width)
    assert first.p_value < 1e-6


def test_whitening_makes_noise_white_and_leaves_phase_alone():
    rng = np.random.default_rng(3)
    parts = [coloured(rng, 16000), coloured(rng, 12000)]
    white = whitened(parts, RATE, None)[0]
    low, high = (frequency_spectrum(white, RATE, np.arange(a, a + 40.0, 0.05)).mean() for a in (2.0, 400.0))
    assert low == pytest.approx(high, rel=0.15)
    pulse = np.zeros(4001)
    pulse[2000] = 1.0
    answer = whitened([pulse], RATE, None)[0][0]
    assert answer == pytest.approx(answer[::-1], abs=1e-9 * np.abs(answer).max())
    kept = whitened(parts, RATE, 100.0)[0]
    assert frequency_spectrum(kept, RATE, np.array([200.0, 300.0])).max() < 1e-3 * low


@pytest.mark.slow
def test_noise_alone_seldom_has_a_line():
    rng = np.random.default_rng(4)
    angle = motor_angle(8.0)
    width = order_width(angle)
    orders = np.arange(0.5, 14.0, width / 4.0)
    frequencies = np.arange(2.0, 100.0, 0.0625)
    false = np.zeros(2)
    draws = 30
    for _ in range(draws):
        parts = [coloured(rng, len(angle)) for _ in range(2)]
        white = whitened(parts, RATE, None)[0]
        found = order_spectrum(np.concatenate(white), np.concatenate([angle, angle]), orders)
        false[0] += bool(lines(orders, found, width, significance=0.01))
        power = frequency_spectrum(parts, RATE, frequencies)
        false[1] += bool(
            lines(frequencies, power, frequency_width(parts, RATE), degrees=4, neighbours=NEIGHBOURS_IN_TIME)
        )
    # One in a hundred is asked for; four of thirty have a chance of 3e-4 then.
    assert np.all(false < 4), false


def test_a_spectrum_of_what_has_nothing_above_a_frequency_needs_fewer_samples():
    time, random = np.arange(20_000) / RATE, np.random.default_rng(5)
    parts = [random.standard_normal(len(time)) + 0.2 * np.sin(2 * np.pi * 11.3 * time) for _ in range(2)]
    low = whitened(parts, RATE, 20.0)[0]
    frequencies = np.arange(1.0, 20.0, 0.03)
    whole = frequency_spectrum(low, RATE, frequencies)
    # A piece that is cut off leaks a little of itself to all frequencies.
    assert np.abs(frequency_spectrum(low, RATE, frequencies, highest=20.0) - whole).max() < 1e-6 * whole.max()


def test_the_floor_at_the_ends_is_the_median_of_the_neighbours_that_there_are():
    positions, power = np.arange(60.0), np.random.default_rng(3).chisquare(2, 60)
    floor = noise_floor(positions, power, 2.0, neighbours=20.0)
    # Of chi-squared with two degrees of freedom.
    to_mean, guard = 1.0 / np.log(2.0), round(GUARD * 2.0)
    for k in (0, 1, 7, 30, 58, 59):
        near = np.concatenate([power[max(0, k - 40) : max(0, k - guard)], power[k + guard + 1 : k + 41]])
        assert floor[k] == pytest.approx(np.median(near) * to_mean, rel=1e-12)
