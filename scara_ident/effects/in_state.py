"""Whether an effect's torque is a function of the present position, velocity and acceleration alone.

It is tried, not declared: a family of somebody's own package cannot be wrong about it.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.signals import Scene
from scara_ident.motion.motion import Motion

# Samples of the motion that is tried, and the least periods of its sines.
SAMPLES, PERIODS = 600, 3.0
# A larger difference, relative to the largest column, is not rounding.
ROUNDING = 1e-9
# Times the recordings' speed: the faster ones reverse every load, also one that gravity holds.
HASTES = (1.0, 10.0)
# The other order is no recording's.
STRANGER = "a recording of another name"


def follows_state(columns: Callable[[Motion], Array], scene: Scene) -> bool:
    """Tell whether columns are the same where the same states come in another order, in a recording of another name.

    Parameters
    ----------
    columns : callable
        Gives the columns on a motion, shape (n, k, N).
    scene : Scene
        How far and how fast the joints move, how long, and in which recordings.
    """
    order = np.random.default_rng(SAMPLES).permutation(SAMPLES)
    for name, haste in product(scene.start or (STRANGER,), HASTES):
        straight = _motion(scene, name, haste)
        q, v, a = (part[:, order] for part in (straight.q, straight.v, straight.a))
        mixed = Motion(STRANGER, STRANGER, straight.time, q, v, a, None, straight.rate)
        expected, found = columns(straight)[:, :, order], columns(mixed)
        if not np.allclose(found, expected, rtol=0.0, atol=ROUNDING * float(np.max(np.abs(expected), initial=0.0))):
            return False
    return True


def _motion(scene: Scene, name: str, haste: float) -> Motion:
    """Return sines of the joints' travel over the length of a recording, at so many times their speed."""
    time = np.linspace(0.0, scene.duration, SAMPLES)
    half = 0.5 * scene.travel[:, None]
    slowest = 2.0 * np.pi * PERIODS / scene.duration
    # A joint that stands still has no pace of its own.
    pace = np.maximum(np.divide(scene.speed[:, None], half, out=np.zeros_like(half), where=half > 0.0), slowest)
    pace *= haste
    angle = pace * time + np.arange(len(half))[:, None]
    q, v, a = half * np.sin(angle), half * pace * np.cos(angle), -half * pace**2 * np.sin(angle)
    return Motion(name, name, scene.start.get(name, 0.0) + time, q, v, a, None, (SAMPLES - 1) / scene.duration)
