"""Powers in bins of frequency."""

from __future__ import annotations

import numpy as np

from scara_ident.estimation.explained_power import binned_power

RATE = 500.0


def test_binned_power_is_the_mean_square_whatever_the_bins():
    rng = np.random.default_rng(0)
    count = 20_000
    signals = rng.standard_normal((2, count)) * np.array([[1.0], [3.0]])
    edges = np.array([0.0, 10.0, 60.0, 250.0])
    power = binned_power(signals, RATE, edges)
    # White noise: shares as wide as the bins.
    np.testing.assert_allclose(power[1] / power[0], 9.0, rtol=0.1)
    np.testing.assert_allclose(power[0] / power[0].sum(), np.diff(edges) / 250.0, rtol=0.1)
    tone = np.sin(2 * np.pi * 30.0 * np.arange(count) / RATE)[None]
    assert binned_power(tone, RATE, edges)[0, 1] > 0.999 * binned_power(tone, RATE, edges).sum()
    np.testing.assert_allclose(binned_power(tone + 7.0, RATE, edges), binned_power(tone, RATE, edges), atol=1e-6)


def test_binned_power_is_the_same_however_the_signals_lie_in_memory():
    signals = np.random.default_rng(0).standard_normal((2, 5000))
    edges = np.array([0.0, 10.0, 60.0, 250.0])
    np.testing.assert_array_equal(
        binned_power(np.asfortranarray(signals), RATE, edges), binned_power(signals, RATE, edges)
    )
