"""How many samples, rows and seconds a band asks for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.motion.rest import FEW_SAMPLES

# Rows per period of the band that are kept: the filter passes little above 1.25 times its cutoff.
ROWS_PER_PERIOD = 2.5
# Samples per period of the band for smooth functions of the motion, which has passed a low-pass of three times the
# band: the smallest number that preserves every reversal of a joint, see `FEW_SAMPLES`.
SMOOTH_PER_PERIOD = FEW_SAMPLES
# A rate is known only up to rounding; a number this near to a whole number counts as one.
ROUNDING = 1e-9
# Blocks are long compared with the memory of the band, so that scores of different blocks are nearly independent.
BLOCK_PERIODS = 4.0
BLOCK_SECONDS = 0.5


def row_step(rate: float, band: float | None) -> int:
    """Return the number of samples per row in a band."""
    return samples_per(rate, (band,), ROWS_PER_PERIOD)


def samples_per(rate: float, bands: Sequence[float | None], per_period: float) -> int:
    """Return of how many samples one leaves so many per period of the widest of some bands, Hz; None filters nothing."""
    widest = max(np.inf if band is None else band for band in bands)
    return max(1, int(rate / (per_period * widest) * (1.0 + ROUNDING)))


def block_seconds(bands: Sequence[float | None]) -> float:
    """Return the length of the blocks of time, s."""
    slowest = min((band for band in bands if band is not None), default=np.inf)
    return float(max(BLOCK_SECONDS, BLOCK_PERIODS / slowest))
