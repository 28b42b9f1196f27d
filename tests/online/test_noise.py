"""Sizes of noise against what was drawn."""

from __future__ import annotations

import numpy as np

from scara_ident.online.filtered import row_filter
from scara_ident.online.noise import PositionNoise, TorqueNoise
from tests.online.made import RATE, signals


def test_the_given_noise_counts_as_so_many_samples():
    noise = TorqueNoise.given(2, 100.0)
    np.testing.assert_array_equal(noise.scale, [1.0, 1.0])
    after = noise.after(np.array([300.0, 0.0]), np.array([100, 0]), 2.0)
    # 100 of variance 1, and 300 of 50 independent ones; what is old fades by 1e-4.
    np.testing.assert_allclose(after.scale, [400.0 / 150.0, 1.0], rtol=1e-3)
    assert after.squares[0] < 400.0


def test_noise_of_positions_is_what_was_added_and_a_silent_encoder_does_not_lower_it():
    way, sigma = row_filter(RATE, 10.0, 1), np.array([1e-4, 4e-4])
    q = signals(20.0)[0]
    random, noise, slow = np.random.default_rng(0), PositionNoise.none(2), np.full(2, 0.01)
    noisy = q + sigma[:, None] * random.standard_normal(q.shape)
    for k in range(0, q.shape[1] - way.window, way.new):
        window = np.array([noisy, 0.0 * noisy])[..., k : k + way.window]
        noise = noise.after(window, way.motion(window), slow, way)
    size = np.sqrt(noise.squares / noise.counted)
    # What the low-pass leaves of it is missing: 2 c^2 sum of squares of its weights, about an eighth.
    np.testing.assert_allclose(size, sigma, rtol=0.1)
    still = np.full((2, 2, way.window), 0.3)
    same = noise.after(still, way.motion(still), slow, way)
    np.testing.assert_array_equal(same.squares, noise.squares)
    np.testing.assert_array_equal(same.counted, noise.counted)
    # At the speed of rest noise alone is five standard deviations away from zero.
    white = sigma[:, None] * random.standard_normal((2, 200 * way.window))
    speeds = [way.motion(np.array([part, part])).v for part in np.split(white, 200, axis=1)]
    assert np.all(noise.rest(way) >= 4.5 * np.std(np.concatenate(speeds, axis=1), axis=1))
    assert np.all(noise.rest(way) >= 0.9 * np.sqrt(12.0) * sigma * way.cut)


def test_before_any_sample_nothing_is_known():
    np.testing.assert_array_equal(PositionNoise.none(3).rest(row_filter(RATE, 10.0, 1)), np.zeros(3))
