"""Recordings at a lower sample rate, for what needs only low frequencies."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.motion.motion import Stretch


def thinned(stretch: Stretch, step: int) -> Stretch:
    """Return means over ``step`` samples in a row, of position and torque alike; the motion is made once.

    White noise keeps its density below the new rate: a mean has 1/step of the samples' power. A stretch of fewer than four
    such means stays as it is.
    """
    if step == 1 or len(stretch.time) < 4 * step:
        return stretch
    if step not in stretch._thinned:
        stretch._thinned[step] = Stretch(
            stretch.name,
            stretch.trajectory,
            _means(stretch.time, step),
            _means(stretch.position, step),
            None,
            stretch.rate / step,
            stretch.source,
            stretch.clipped if isinstance(stretch.clipped, bool) else _means(stretch.clipped.astype(float), step) > 0.0,
        )
    torque = None if stretch.torque is None else _means(stretch.torque, step)
    return replace(stretch._thinned[step], torque=torque)


def _means(signal: Array, step: int) -> Array:
    count = signal.shape[-1] // step
    return np.asarray(signal[..., : count * step].reshape(*signal.shape[:-1], count, step).mean(axis=-1))
