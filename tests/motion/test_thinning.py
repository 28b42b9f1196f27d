"""Means of samples: what is slow stays, and noise keeps its density."""

from __future__ import annotations

import numpy as np

from scara_ident.motion.motion import Stretch
from scara_ident.motion.thinning import thinned

RATE = 1000.0


def stretch(position: np.ndarray, torque: np.ndarray | None) -> Stretch:
    time = 3.0 + np.arange(position.shape[1]) / RATE
    return Stretch("a_1", "a", time, position, torque, RATE, slice(0, position.shape[1]))


def test_slow_signals_stay_where_they_were_in_time():
    time = 3.0 + np.arange(10_003) / RATE
    slow = np.sin(2.0 * np.pi * 0.5 * time)[None]
    part = thinned(stretch(slow, 2.0 * slow), 10)
    assert part.rate == 100.0
    assert part.position.shape == (1, 1000)
    # A mean over 10 ms takes off (pi f T)^2 / 6 of the amplitude.
    np.testing.assert_allclose(part.position[0], np.sin(np.pi * part.time), atol=(np.pi * 0.5 * 0.01) ** 2 / 6 * 1.1)
    assert part.torque is not None
    np.testing.assert_allclose(part.torque, 2.0 * part.position)


def test_white_noise_keeps_its_density():
    noise = np.random.default_rng(0).standard_normal((1, 200_000))
    part = thinned(stretch(noise, None), 8)
    assert part.torque is None
    np.testing.assert_allclose(np.var(part.position) / part.rate, np.var(noise) / RATE, rtol=0.03)


def test_motion_is_made_once_and_short_stretches_stay():
    signal = np.random.default_rng(0).standard_normal((1, 40))
    whole = stretch(signal, signal)
    assert thinned(whole, 5).position is thinned(whole, 5).position
    assert thinned(whole, 1) is whole
    assert thinned(whole, 11) is whole
