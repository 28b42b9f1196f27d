"""How large the noise is, as it shows itself: of torques in what the parameters leave of them, of positions about a low-pass."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.motion.motion import Motion
from scara_ident.motion.rest import REST_NOISE
from scara_ident.online.filtered import RowFilter

# Samples that the size of the noise is averaged over.
NOISE_SAMPLES = 1e6
# The given noise counts as this many samples, so that the first ones do not decide, or as this many filtered rows of each joint: what is
# known of raw noise is less sure within a band, and rows are fewer; of so many the size is known to a fourteenth.
GIVEN_SAMPLES = 1e3
GIVEN_ROWS = 1e2


@dataclass(frozen=True, eq=False)
class TorqueNoise:
    """The variance of the torques' noise in units of what was given, of all joints together or of each.

    Attributes
    ----------
    squares, counted : ndarray, shape (m,)
        Sum of squares, and of how many independent samples.
    """

    squares: Array
    counted: Array

    @staticmethod
    def given(sizes: int, samples: float) -> TorqueNoise:
        """Return what is given, which counts as so many samples."""
        return TorqueNoise(np.full(sizes, samples), np.full(sizes, samples))

    @property
    def scale(self) -> Array:
        """Variance, shape (m,)."""
        return self.squares / self.counted

    def after(self, squares: Array, moving: Array, dependent: float) -> TorqueNoise:
        """Return it with sums of squares, shape (m,), of so many samples, of which ``dependent`` stand for an independent one."""
        fade = np.maximum(0.0, 1.0 - moving / NOISE_SAMPLES)
        return TorqueNoise(fade * self.squares + squares, fade * self.counted + moving / dependent)


@dataclass(frozen=True, eq=False)
class PositionNoise:
    """How far raw positions scatter about the low-passed ones while joints move.

    Attributes
    ----------
    squares, counted : ndarray, shape (n,)
        Sum of squares, and of how many samples.
    """

    squares: Array
    counted: Array

    @staticmethod
    def none(joints: int) -> PositionNoise:
        """Return what is known before any sample."""
        return PositionNoise(np.zeros(joints), np.zeros(joints))

    def after(self, window: Array, motion: Motion, rest: Array, way: RowFilter) -> PositionNoise:
        """Return it with a window of raw samples; while a joint rests, shape (n,) of speeds, its encoder is silent."""
        middle = (len(way.taps) - 1) // 2
        raw = window[0, :, middle : middle + (motion.samples - 1) * way.every + 1 : way.every]
        moves = np.abs(motion.v) > rest[:, None]
        squares = np.sum(np.where(moves, (raw - motion.q) ** 2, 0.0), axis=1)
        return PositionNoise(self.squares + squares, self.counted + np.count_nonzero(moves, axis=1))

    def rest(self, way: RowFilter) -> Array:
        """Return the speeds, shape (n,), below which noise or the steps of an encoder may be what moves each joint.

        Of white noise the filtered velocity has what its weights let through. Steps of size s are noise of s / sqrt(12); slower
        than s times the low-pass's frequency they pass it one by one, see `stepping_speeds`.
        """
        sigma = np.sqrt(self.squares / np.maximum(self.counted, 1.0))
        white = REST_NOISE * float(np.linalg.norm(way.taps[:, 1]))
        return np.asarray(sigma * max(white, np.sqrt(12.0) * way.cut))
