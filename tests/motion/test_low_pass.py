"""The low-pass and its derivatives: exact where they can be, and without phase."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from scara_ident.motion.low_pass import (
    ROWS_AT_ONCE,
    derivative,
    differentiate,
    low_pass,
    low_pass_between,
    low_pass_every,
    noise_share,
    removed_share,
)
from scara_ident.motion.sampling import row_step
from tests.motion.test_motion import RATE, sine


@pytest.mark.parametrize("frequency", [0.5, 2.0, 5.0])
@pytest.mark.parametrize(("cut", "ends", "error"), [(20.0, 1000, 1e-11), (50.0, 1000, 1e-10), (200.0, 500, 1e-5)])
def test_derivatives_of_a_sine_are_those_of_the_filtered_sine(frequency: float, cut: float, ends: int, error: float):
    """Away from the ends; the error left at 200 Hz is that of the signal's ends ringing on."""
    time = np.arange(4000) / RATE
    gain = 1.0 / (1.0 + (frequency / cut) ** 8)
    found = differentiate(sine(frequency, time)[0][None], RATE, cut)
    for made, exact in zip(found, sine(frequency, time), strict=True):
        scale = np.max(np.abs(exact))
        assert_allclose(made[0, ends:-ends], gain * exact[ends:-ends], rtol=0, atol=error * scale)


@pytest.mark.parametrize("count", [60, 400, 4000])
@pytest.mark.parametrize("frequency", [2.0, 5.0, 50.0])
def test_derivatives_without_a_filter_are_exact_but_for_a_few_samples_at_the_ends(count: int, frequency: float):
    time = np.arange(count) / RATE
    smooth, first, second = differentiate(sine(frequency, time)[0][None], RATE, None)
    exact = sine(frequency, time)
    inside = slice(20, -20)
    assert_allclose(smooth[0], exact[0], atol=1e-14)
    assert_allclose(first[0, inside], exact[1][inside], rtol=0, atol=1e-4 * np.max(np.abs(exact[1])))
    assert_allclose(second[0, inside], exact[2][inside], rtol=0, atol=2e-4 * np.max(np.abs(exact[2])))


def test_two_periods_of_the_cut_off_from_the_ends_the_error_is_small():
    """What END_PERIODS of prepared stretches and their tripled position filter rely on."""
    time = np.arange(4000) / RATE
    for cut in (20.0, 50.0):
        made = differentiate(sine(1.0, time)[0][None], RATE, cut)
        for found, exact, error in zip(made, sine(1.0, time), (1e-5, 2e-4, 2e-3), strict=True):
            ends = int(2 * RATE / cut)
            assert_allclose(found[0, ends:-ends], exact[ends:-ends], rtol=0, atol=error * np.max(np.abs(exact)))


@pytest.mark.parametrize("cut", [None, 20.0])
def test_one_derivative_is_that_of_all_three_and_is_transformed_back_alone(monkeypatch: pytest.MonkeyPatch, cut):
    signal = np.random.default_rng(0).standard_normal((2, 1000))
    every = differentiate(signal, RATE, cut)
    transform, back = np.fft.irfft, list[int]()
    monkeypatch.setattr(
        np.fft, "irfft", lambda spectra, *given, **more: back.append(len(spectra)) or transform(spectra, *given, **more)
    )
    for order, expected in enumerate(every):
        assert_array_equal(derivative(signal, RATE, cut, order), expected)
    assert back == [1, 1, 1]


@pytest.mark.parametrize("count", [2001, 2000])
def test_the_filter_has_no_phase(count: int):
    """Its impulse response is symmetric, that of the derivative antisymmetric."""
    impulse = np.zeros((1, count))
    impulse[0, 1000] = 1.0
    smooth, first, second = (part[0] for part in differentiate(impulse, RATE, 30.0))
    before, after = slice(999, 200, -1), slice(1001, 1800)
    assert_allclose(smooth[before], smooth[after], atol=1e-15)
    assert_allclose(first[before], -first[after], atol=1e-12)
    assert_allclose(second[before], second[after], atol=1e-9)
    assert np.sum(smooth) == pytest.approx(1.0, rel=1e-9)
    assert np.argmax(smooth) == 1000


def test_a_delay_is_kept_as_it_is():
    time = np.arange(4000) / RATE
    late = low_pass(sine(3.0, time - 0.05)[0], RATE, 10.0)
    prompt = low_pass(sine(3.0, time)[0], RATE, 10.0)
    assert_allclose(late[1050:2950], prompt[1000:2900], atol=1e-9)


@settings(max_examples=20)
@given(st.floats(5.0, 300.0), st.sampled_from([0.5, 1.0, 2.0]))
def test_half_the_amplitude_is_left_at_the_cut_off(cut: float, ratio: float):
    time = np.arange(6000) / RATE
    signal = sine(cut, time)[0]
    found = low_pass(signal, RATE, cut / ratio)
    expected = 1.0 / (1.0 + ratio**8)
    assert_allclose(found[2000:-2000], expected * signal[2000:-2000], atol=1e-3)


def test_no_cut_off_leaves_the_signal_alone():
    signal = np.random.default_rng(0).standard_normal((2, 50))
    assert low_pass(signal, RATE, None) is signal


@settings(max_examples=60)
@given(count=st.integers(4, 3000), cut=st.floats(2.0, 100.0), step=st.integers(1, 8), seed=st.integers(0, 2**16))
def test_the_low_pass_at_kept_samples_is_the_low_pass(count: int, cut: float, step: int, seed: int):
    rate = 500.0
    step = min(step, row_step(rate, cut))
    walk = np.cumsum(np.random.default_rng(seed).standard_normal((2, count)), axis=1)
    kept = low_pass_every(walk, rate, cut, step)
    assert_allclose(kept, low_pass(walk, rate, cut, step)[:, ::step], rtol=0, atol=1e-12 * np.ptp(walk))
    # However the signal is continued, away from its ends the filter is the same.
    inner = slice(int(2 * rate / cut), count - int(2 * rate / cut))
    assert_allclose(
        low_pass(walk, rate, cut, step)[:, inner], low_pass(walk, rate, cut)[:, inner], rtol=0, atol=1e-6 * np.ptp(walk)
    )


@settings(max_examples=60)
@given(
    count=st.integers(4, 3000), cut=st.floats(2.0, 100.0), step=st.integers(1, 60), every=st.integers(1, 12),
    rows=st.integers(0, 2 * ROWS_AT_ONCE + 1), seed=st.integers(0, 2**16),
)  # fmt: skip
def test_the_low_pass_between_given_samples_is_the_low_pass(
    count: int, cut: float, step: int, every: int, rows: int, seed: int
):
    """At every sample of a signal that moves on evenly between the given ones, from its first on."""
    rate = 500.0
    step = min(step, row_step(rate, cut))
    every = min(every, max(1, int(rate / (20.0 * cut))))
    random = np.random.default_rng(seed)
    time = np.arange((count - 1) * every + 1) / rate
    frequency = cut * np.array([0.2, 0.6, 0.9, 1.3, 2.0])[:, None]
    slow = random.standard_normal((rows, 5)) @ np.sin(2.0 * np.pi * frequency * time + frequency) + 3.0 * time
    # Without a step in what is filtered, which the given samples do not hold.
    weight = np.sin(np.pi * np.arange(len(time)) / max(1, len(time) - 1)) ** 4
    found = low_pass_between(slow[:, ::every], rate, cut, step, every, weight[::every])
    expected = low_pass_every(slow, rate, cut, step, weight)
    assert found.shape == expected.shape
    assert_allclose(found, expected, rtol=0, atol=1e-3 * np.max(np.abs(slow), initial=1.0))


@pytest.mark.parametrize("step", [1, 4])
def test_of_no_signals_nothing_is_left(step: int):
    assert low_pass_every(np.zeros((0, 1001)), 1000.0, 50.0, step).shape == (0, -(-1001 // step))


def test_without_a_band_every_sample_is_itself():
    signal = np.arange(20.0)[None]
    assert_array_equal(low_pass_every(signal, 100.0, None, 3), signal[:, ::3])


@pytest.mark.parametrize("cut", [None, 1.0, 20.0])
@pytest.mark.parametrize("count", [4, 7, 50, 3000])
def test_a_constant_and_a_ramp_pass_unchanged(count: int, cut: float | None):
    time = np.arange(count) / RATE
    signal = np.array([np.full(count, 2.5), 3.0 * time - 1.0])
    smooth, first, second = differentiate(signal, RATE, cut)
    assert_allclose(smooth, signal, atol=1e-13)
    assert_allclose(first, np.array([[0.0], [3.0]]) * np.ones(count), atol=1e-9)
    assert_allclose(second, 0.0, atol=1e-5)


@pytest.mark.parametrize("count", [4, 5, 8, 30])
def test_short_signals_give_finite_numbers(count: int):
    signal = np.random.default_rng(count).standard_normal((1, count))
    for cut in (None, 5.0, 400.0):
        for part in differentiate(signal, RATE, cut):
            assert part.shape == (1, count)
            assert np.all(np.isfinite(part))


@settings(max_examples=20)
@given(st.integers(0, 1000), st.floats(-5, 5), st.floats(-5, 5))
def test_the_filter_is_linear_and_works_row_by_row(seed: int, a: float, b: float):
    x, y = np.random.default_rng(seed).standard_normal((2, 300))
    together = low_pass(np.array([x, y, a * x + b * y]), RATE, 40.0)
    assert_allclose(together[2], a * together[0] + b * together[1], atol=1e-12 * (1 + abs(a) + abs(b)))
    assert_allclose(together[0], low_pass(x, RATE, 40.0), atol=1e-14)


def test_time_runs_backwards_through_the_filter_alike():
    x = np.random.default_rng(1).standard_normal(500)
    assert_allclose(low_pass(x[::-1], RATE, 40.0)[::-1], low_pass(x, RATE, 40.0), atol=1e-12)


@pytest.mark.parametrize("shape", [(3000,), (6, 3000)])
def test_a_weight_is_multiplied_in_before_the_filter(shape: tuple[int, ...]):
    rng = np.random.default_rng(0)
    signals, weight = rng.standard_normal((6, 3000)), rng.uniform(size=shape)
    assert_allclose(
        low_pass_every(signals, RATE, 40.0, 7, weight),
        low_pass_every(weight * signals, RATE, 40.0, 7),
        rtol=0,
        atol=1e-15,
    )
    assert_array_equal(low_pass_every(signals, RATE, None, 7, weight), (weight * signals)[:, ::7])


@pytest.mark.parametrize("cut", [5.0, 20.0, None])
def test_the_share_of_white_noise_that_passes(cut: float | None):
    noise = np.random.default_rng(3).standard_normal((40, 4000))
    # Away from the ends, where the continued signal turns about its last sample.
    passed = low_pass(noise, 500.0, cut)[:, 400:-400]
    # The variance of 40 times 2 B T values is known to 3 % at the narrowest.
    assert np.var(passed) == pytest.approx(noise_share(500.0, cut), rel=0.1)


@pytest.mark.parametrize("cut", [40.0, 100.0, 190.0])
def test_the_share_of_noise_that_is_taken_out_is_what_white_noise_loses(cut: float):
    noise = np.random.default_rng(0).standard_normal(200_000)
    assert np.var(noise - low_pass(noise, 500.0, cut)) == pytest.approx(removed_share(500.0, cut), rel=0.02)
