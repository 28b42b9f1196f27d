"""Residuals of two joints whose law is known."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from scara_ident.use.external_torque import FEATURES, Observed

RATE = 20.0


def residual(
    seed: int, noise: Callable[[np.random.Generator, tuple[int, int]], np.ndarray], seconds: float
) -> Observed:
    """Noise of two joints, three times as large on the first while it is slow."""
    rng, count = np.random.default_rng(seed), round(seconds * RATE)
    time = np.arange(count) / RATE
    slow = np.sin(0.3 * time) > 0.0
    features = np.zeros((2, len(FEATURES), count))
    features[:, 3, :], features[:, 4, :] = slow, ~slow
    size = np.array([np.where(slow, 3.0, 1.0), np.full(count, 0.1)])
    return Observed(f"n{seed}", time, np.zeros((2, count)), size * noise(rng, (2, count)), features, time > 1.0)
