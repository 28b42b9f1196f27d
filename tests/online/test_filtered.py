"""The filter against closed forms: derivatives of sines, rows that are independent, and an equation that still holds."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scara_ident.online.filtered import RowFilter, derivatives, pulse, row_filter
from tests.online.made import NOISE, RATE, model, signals, torque, truth

BAND = 10.0
# Speed of rest of exact positions.
SLOW = np.full(2, 0.01)


def windows(way: RowFilter, samples: np.ndarray) -> list[np.ndarray]:
    return [samples[..., k : k + way.window] for k in range(0, samples.shape[-1] - way.window + 1, way.new)]


def rows_of(way: RowFilter, samples: np.ndarray, weight: np.ndarray) -> list[np.ndarray]:
    found = []
    for window in windows(way, samples):
        motion = way.motion(window)
        found.append(way.rows(model(), motion, way.moving(motion, SLOW), weight))
    return [np.concatenate(own) for own in zip(*found, strict=True)]


@pytest.mark.parametrize("share", [0.1, 0.5, 1.0])
def test_motion_within_the_band_passes_with_its_derivatives(share):
    way = row_filter(RATE, BAND, 1)
    time, omega = np.arange(way.window) / RATE, 2.0 * np.pi * share * BAND
    window = np.broadcast_to(np.sin(omega * time), (2, 2, way.window))
    motion = way.motion(window)
    at = omega * (motion.time + (len(way.taps) - 1) / 2.0 / RATE)
    # The filter leaves the band as it is to 1e-4.
    for found, size, shape in ((motion.q, 1.0, np.sin), (motion.v, omega, np.cos), (motion.a, -(omega**2), np.sin)):
        np.testing.assert_allclose(found[0], size * shape(at), atol=1e-4 * abs(size))
    np.testing.assert_array_equal(motion.torque, motion.q)


def test_weights_are_exact_for_a_parabola_and_stop_what_is_fast():
    taps = derivatives(RATE, 30.0, 0.1)
    t = (np.arange(len(taps)) - len(taps) // 2) / RATE
    np.testing.assert_allclose((3.0 + 2.0 * t + 5.0 * t**2) @ taps, [3.0, 2.0, 10.0], atol=1e-2)
    np.testing.assert_allclose((3.0 + 2.0 * t) @ taps, [3.0, 2.0, 0.0], atol=1e-8)
    fast = np.abs(np.exp(2j * np.pi * np.outer(np.linspace(60.0, 0.5 * RATE, 100), t)) @ taps)
    assert np.max(fast / [1.0, 2.0 * np.pi * 30.0, (2.0 * np.pi * 30.0) ** 2]) < 1e-4


@pytest.mark.parametrize("step", [5, 10, 13])
def test_a_pulse_is_orthogonal_to_its_shifts(step):
    one = pulse(step)
    for rows in range(1, 6):
        assert abs(one[rows * step :] @ one[: len(one) - rows * step]) < 5e-4
    np.testing.assert_allclose(one @ one, 1.0)
    # The power at the band's end, half of a row's rate, is half of that in the middle of the band; none is left at twice.
    gain = [abs(np.exp(2j * np.pi * f / step * np.arange(len(one))) @ one) ** 2 for f in (0.0, 0.5, 1.05)]
    np.testing.assert_allclose(gain[1] / gain[0], 0.5, atol=5e-3)
    assert gain[2] < 1e-6 * gain[0]


@given(st.floats(50.0, 4000.0), st.floats(0.005, 0.1), st.integers(1, 300))
def test_blocks_follow_each_other_at_any_rate(rate, share, block):
    way = row_filter(rate, share * rate, block)
    assert way.new >= block and len(way.pulses) >= 4 and way.widen >= 1
    # Rows come twice in a period of the band, to the rounding of a row to whole samples.
    assert abs(rate / (way.every * way.step) / (2.0 * share * rate) - 1.0) < 0.12
    samples = np.zeros((2, 2, way.window))
    motion = way.motion(samples)
    assert motion.samples == way.pulses.shape[1] + 2 * way.widen
    assert way.moving(motion, np.zeros(2)).shape == (2, way.pulses.shape[1])
    # The pulse after the last one of a block is the first one of the next.
    first, second = np.flatnonzero(way.pulses[0])[0], np.flatnonzero(way.pulses[1])[0]
    assert (second - first) * way.every * len(way.pulses) == way.new


def test_long_blocks_have_the_rows_of_short_ones():
    states = signals(6.0)
    samples = np.array([states[0], torque(states, truth())])
    short, long = (row_filter(RATE, BAND, block) for block in (1, 180))
    assert len(long.pulses) == 2 * len(short.pulses)
    some, all_ = rows_of(short, samples, 1.0 / NOISE), rows_of(long, samples, 1.0 / NOISE)
    for one, other in zip(some, all_, strict=True):
        count = min(len(one), len(other))
        assert count > 80
        np.testing.assert_allclose(one[:count], other[:count], rtol=1e-9, atol=1e-9)


def test_the_equation_holds_of_rows_and_not_of_filtered_states():
    states, way = signals(10.0), row_filter(RATE, BAND, 1)
    clean = torque(states, truth()) - torque(states, 0.0 * truth())
    found = []
    for rows, own in zip(rows_of(way, np.array([states[0], clean]), np.ones(2)), model().active, strict=True):
        found.append(np.std(rows[:, -1] - rows[:, :-1] @ truth()[own]) / np.std(rows[:, -1]))
    # Of friction that jumps at a turn all is left out but what its widening does not cover.
    assert max(found) < 2e-3
    from scipy.signal import butter, lfilter

    low = [lfilter(*butter(2, BAND, fs=RATE), part) for part in (*states, clean)]
    naive = low[3] - (torque(low[:3], truth()) - torque(low[:3], 0.0 * truth()))
    assert np.std(naive[:, 500:]) / np.std(clean) > 5.0 * max(found)


def test_rows_of_white_noise_are_independent_and_of_unit_variance():
    states, way = signals(120.0), row_filter(RATE, BAND, 1)
    noise = NOISE[:, None] * np.random.default_rng(3).standard_normal(states[0].shape)
    for rows in rows_of(way, np.array([states[0], noise]), 1.0 / NOISE):
        own, count = rows[:, -1], len(rows)
        assert count > 2000
        # Four standard deviations of a variance and of a correlation of so many.
        np.testing.assert_allclose(np.mean(own**2), 1.0, atol=4.0 * np.sqrt(2.0 / count))
        for lag in (1, 2, 3):
            assert abs(np.mean(own[lag:] * own[:-lag])) < 4.0 / np.sqrt(count)


def test_rest_and_turns_are_left_out_and_widened():
    way = row_filter(RATE, BAND, 1)
    time = np.arange(way.window) / RATE - 0.5 * way.window / RATE
    # The first joint turns in the middle, the second rests.
    motion = way.motion(np.array([[np.cos(8.0 * time), 0.0 * time + 1.0]] * 2))
    moving = way.moving(motion, SLOW)
    inner = motion.time[way.widen : -way.widen] - np.mean(motion.time)
    near = np.abs(inner) < (way.widen - 1) * way.every / RATE
    assert not np.any(moving[0, near]) and not np.any(moving[1])
    assert np.all(moving[0, (np.abs(inner) > 0.06) & (np.abs(inner) < 0.3)])
    first, second = way.rows(model(), motion, moving, np.ones(2))
    assert len(first) > 0 and second.shape == (0, len(model().active[1]) + 1)
