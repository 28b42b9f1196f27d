"""Estimates of the noise: of torques by the residual, of positions about a low-pass."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import Motion
from scara_ident.motion.rest import REST_NOISE
from scara_ident.online.filtered import RowFilter

# Noise of positions that makes this share of what is left of rows is too much: as it grows with the square of frequency, it is then over
# three times the torque's at the end of the band. With 0.37 there were 1.2 to 1.9 times the alarms asked for, with 0.44 3.5 times.
MAX_NOISE_SHARE = 0.4
# By so many standard deviations it is surely more.
SIGNIFICANT_STDS = 2.0
# In a band that does it is no more than the torque's even there, and so a fifth of it over the band.
SUFFICIENT_NOISE_SHARE = 0.2
# In a row it grows as this power of the band. From this share on nothing of the rest is determined by what is left.
GROWTH, NEARLY_ALL = 4.0, 0.95
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

    def seen(self, samples: float) -> Array:
        """Return the variance, shape (m,), by what was seen since the start alone, where what was given counted as so many samples."""
        return (self.squares - samples) / np.maximum(self.counted - samples, np.finfo(float).tiny)

    def after(self, squares: Array, moving: Array, dependent: float) -> TorqueNoise:
        """Return it with sums of squares, shape (m,), of so many samples, of which ``dependent`` stand for an independent one."""
        fade = np.maximum(0.0, 1.0 - moving / NOISE_SAMPLES)
        return TorqueNoise(fade * self.squares + squares, fade * self.counted + moving / dependent)


@dataclass(frozen=True, eq=False)
class PositionNoise:
    """How far raw positions scatter about the low-passed ones while joints move, and what that makes of rows.

    Attributes
    ----------
    squares, counted : ndarray, shape (n,)
        Sum of squares, and of how many samples.
    made, rows : ndarray, shape (n,)
        Sum over rows of the variance that it makes of each, in units of the given noise of torques, and of how many.
    """

    squares: Array
    counted: Array
    made: Array
    rows: Array

    @staticmethod
    def none(joints: int) -> PositionNoise:
        """Return what is known before any sample."""
        return PositionNoise(*np.zeros((4, joints)))

    def after(self, window: Array, motion: Motion, rest: Array, way: RowFilter) -> PositionNoise:
        """Return it with a window of raw samples; while a joint rests, shape (n,) of speeds, its encoder is silent."""
        middle = (len(way.taps) - 1) // 2
        raw = window[0, :, middle : middle + (motion.samples - 1) * way.every + 1 : way.every]
        moves = np.abs(motion.v) > rest[:, None]
        squares = np.sum(np.where(moves, (raw - motion.q) ** 2, 0.0), axis=1)
        return replace(self, squares=self.squares + squares, counted=self.counted + np.count_nonzero(moves, axis=1))

    def after_rows(self, inertia: Array, weight: Array, rows: Array, way: RowFilter) -> PositionNoise:
        """Return it with so many rows of each joint, shape (n,), by the torques per acceleration (n, n) and weights of torques (n,)."""
        made = weight**2 * way.acceleration_gain * (inertia**2 @ self.variance(way))
        return replace(self, made=self.made + made * rows, rows=self.rows + rows)

    @property
    def in_rows(self) -> Array:
        """Variance that it makes of a row of each joint, shape (n,); 0 as long as few are counted."""
        return np.where(self.rows >= GIVEN_ROWS, self.made / np.maximum(self.rows, 1.0), 0.0)

    def variance(self, way: RowFilter) -> Array:
        """Return the variance of white noise, shape (n,), of which so much is left beside the low-pass."""
        middle = (len(way.taps) - 1) // 2
        apart = -way.taps[:, 0]
        apart[middle] += 1.0
        return np.asarray(self.squares / np.maximum(self.counted, 1.0) / (apart @ apart))

    def rest(self, way: RowFilter) -> Array:
        """Return the speeds, shape (n,), below which noise or the steps of an encoder may be what moves each joint.

        Of white noise the filtered velocity has what its weights let through. Steps of size s are noise of s / sqrt(12); slower
        than s times the low-pass's frequency they pass it one by one, see `stepping_speeds`.
        """
        sigma = np.sqrt(self.squares / np.maximum(self.counted, 1.0))
        white = REST_NOISE * float(np.linalg.norm(way.taps[:, 1]))
        return np.asarray(sigma * max(white, np.sqrt(12.0) * way.cut))


def inertia_at(model: TorqueModel, value: Array, q: Array) -> Array:
    """Return the torque of every joint per acceleration of every joint, shape (n, n), at a position (n,) by the model's parameters."""
    joints = len(q)
    still, a = np.zeros((joints, joints + 1)), np.eye(joints, joints + 1, 1)
    motion = Motion("online", "online", np.arange(joints + 1.0), q[:, None] + still, still, a, None, 1.0)
    columns = model.joint_columns(motion)
    torque = np.array([value[own] @ rows for own, rows in zip(model.active, columns, strict=True)])
    return np.asarray(torque[:, 1:] - torque[:, :1])


def too_wide(of_positions: Array, whole: Array, rows: Array, band: float, joints: Sequence[str]) -> str | None:
    """Say so where the noise of positions outweighs the torque's, and which band would do; None where it does not.

    Parameters
    ----------
    of_positions, whole : ndarray, shape (n,)
        Variance that it makes of a row of each joint, and of all that is left of one, in units of the given noise of torques.
    rows : ndarray, shape (n,)
        How many tell the latter.
    band : float
        Hz.
    """
    share = of_positions / np.where(of_positions > 0.0, whole, 1.0)
    # A variance of N rows is known to the root of 2 / N of it.
    outweighs = share > MAX_NOISE_SHARE * (1.0 + SIGNIFICANT_STDS * np.sqrt(2.0 / np.maximum(rows, 1.0)))
    if not np.any(outweighs):
        return None
    # Where nearly all is noise of positions the difference does not tell the rest, of which what was given is all that is known.
    torque = np.where(share < NEARLY_ALL, whole - of_positions, np.minimum(1.0, (1.0 - NEARLY_ALL) * whole))
    narrower = band * float(
        np.min(
            (SUFFICIENT_NOISE_SHARE * torque / np.maximum(of_positions, SUFFICIENT_NOISE_SHARE * torque))
            ** (1.0 / GROWTH)
        )
    )
    each = ", ".join(
        f"{min(x, 1.0):.0%} on {joint}" for joint, x, sure in zip(joints, share, outweighs, strict=True) if sure
    )
    return (
        f"in a band of {band:g} Hz the noise of positions makes {each} of the residual torque, so rows are not "
        f"independent, their stated noise is wrong and there are more alarms than requested; use a band of "
        f"{narrower:.2g} Hz"
    )
