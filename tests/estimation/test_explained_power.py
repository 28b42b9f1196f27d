"""Powers in bins of frequency."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.estimation.explained_power import binned_power, sample
from scara_ident.motion.prepared import PreparedData, prepare
from scara_ident.recording.recording import Recording

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


def runs(trajectories: int, repetitions: int, samples: int) -> PreparedData:
    """Return repetitions of some trajectories in turn: all of the first, then all of the second."""
    random = np.random.default_rng(0)
    time = np.arange(samples) / 100.0
    made = []
    for trajectory in range(trajectories):
        wave = np.sum([np.sin(f * time + random.uniform(0.0, 6.0)) for f in random.uniform(0.5, 3.0, 5)], axis=0)
        for repetition in range(1, repetitions + 1):
            position = (wave + 1e-5 * random.standard_normal(samples))[None]
            name = f"T{trajectory}"
            made.append(Recording(f"{name}_{repetition}", name, repetition, ("joint",), time, position, position))
    return prepare(made)


@pytest.mark.parametrize(
    ("trajectories", "repetitions", "samples", "names"),
    [
        (2, 3, 800, ["T0_1", "T1_1", "T0_2", "T1_2", "T0_3"]),
        (2, 3, 2000, ["T0_1", "T1_1"]),
        (3, 2, 4000, ["T0_1", "T1_1", "T2_1"]),
        (6, 1, 4000, ["T0_1", "T1_1", "T2_1", "T3_1", "T4_1"]),
        (1, 2, 30_000, ["T0_1"]),
    ],
)
def test_repetitions_are_looked_at_only_where_trajectories_are_few(
    trajectories: int, repetitions: int, samples: int, names: list[str]
):
    chosen = sample(runs(trajectories, repetitions, samples))
    assert [item.name for item in chosen.recordings] == names
