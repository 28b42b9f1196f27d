"""A residual in bins of time, bounded sample by sample so that a single one says little."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array, median, runs_of
from scara_ident.motion.prepared import PreparedStretch
from scara_ident.motion.rest import standstill

# Length of a bin, s.
BIN = 0.04
# Standard deviations at which a sample's residual is bounded, and the normal's over its median absolute value.
BOUND = 5.0
NORMAL = 1.4826
# Nothing is said of a joint slower than this share of its peak speed, where friction is known least.
MIN_SPEED_SHARE = 0.03
# The arm stands still where all joints are slower than this share, and for so long, s, before and after; longer than this, s.
STANDSTILL_SHARE, SETTLING_SECONDS, MIN_STANDSTILL = 0.01, 0.06, 0.12
# Share of a window that has to be used, or nothing is said of it.
FILLED = 0.6
# Samples of a stretch that its standard deviation is taken from.
SCALE_SAMPLES = 5000


@dataclass(frozen=True, eq=False)
class Binned:
    """A stretch's residual in bins of time.

    Attributes
    ----------
    recording : int
        Place of its recording.
    size : int
        Samples in a bin.
    raw : ndarray, shape (n, M * size)
        Residual at every sample, nothing filtered, N m or N.
    used : ndarray of bool, shape (n, M * size)
        Samples that count.
    noise : ndarray, shape (n,)
        Standard deviation that samples are bounded by.
    state : tuple of ndarray, shape (n, M)
        Position, velocity, acceleration and predicted torque in the middle of each bin.
    taken : ndarray, shape (n, M)
        What is taken off the residual before it is bounded.
    """

    recording: int
    part: PreparedStretch
    size: int
    raw: Array
    used: NDArray[np.bool_]
    noise: Array
    state: tuple[Array, Array, Array, Array]
    taken: Array

    @cached_property
    def known(self) -> Array:
        """Share of each bin that is used, shape (n, M)."""
        return _bin_means(self.used.astype(float), self.size)

    @cached_property
    def left(self) -> Array:
        """Mean residual over what is used of each bin, bounded sample by sample, shape (n, M)."""
        return self.bounded(BOUND)

    @cached_property
    def anyhow(self) -> Array:
        """The same over all of each bin, whether it is used or not, shape (n, M)."""
        return replace(self, used=np.ones_like(self.used)).bounded(BOUND)

    def bounded(self, bound: float) -> Array:
        """Return the mean residual of bins with samples bounded at so many standard deviations, shape (n, M)."""
        shape = (*self.taken.shape, self.size)
        inside = self.raw.reshape(shape) - self.taken[:, :, None]
        if np.isfinite(bound):
            most = (bound * self.noise)[:, None, None]
            np.clip(inside, -most, most, out=inside)
        inside *= self.used.reshape(shape)
        return _bin_means(inside, self.size) / np.maximum(self.known, 1.0 / self.size)

    @cached_property
    def still(self) -> Array:
        """Mean recorded torque less the predicted over each bin in which the whole arm stands still, else NaN, shape (n, M).

        The predicted is the median over each rest: of friction only that is known at rest that it is constant.
        """
        shape = (*self.taken.shape, self.size)
        speed = np.abs(self.part.motion.v[:, : self.raw.shape[1]])
        moving = np.any(speed > STANDSTILL_SHARE * np.max(speed, axis=1, keepdims=True), axis=0)
        wide = round(SETTLING_SECONDS * self.part.rate)
        near = np.convolve(moving, np.ones(2 * wide + 1), mode="same") > 0.5
        rest = np.logical_not(np.any(near.reshape(shape[1:]), axis=1))
        torque = self.part.torque[:, : self.raw.shape[1]]
        predicted = _bin_means(torque - self.raw, self.size)
        recorded, found = _bin_means(torque, self.size), np.full(shape[:2], np.nan)
        for begin, end in runs_of(rest):
            if (end - begin) * self.width > MIN_STANDSTILL:
                inside = slice(begin, end)
                found[:, inside] = recorded[:, inside] - np.median(predicted[:, inside], axis=1, keepdims=True)
        return found

    def without(self, more: Array) -> Binned:
        """Return it with more taken off the residual, shape (n, M)."""
        return replace(self, taken=self.taken + more)

    @property
    def width(self) -> float:
        """Length of a bin, s."""
        return self.size / self.part.rate

    @cached_property
    def sums(self) -> tuple[Array, Array]:
        """Sums of residual and use up to each bin, shape (n, M + 1)."""
        return _up_to_each(self.left * self.known), _up_to_each(self.known)

    def means(self, length: int) -> Array:
        """Return the mean over windows of so many bins, shape (n, M - length + 1); NaN where too little is used."""
        total, used = (item[:, length:] - item[:, :-length] for item in self.sums)
        return np.where(used >= FILLED * length, total / np.maximum(used, FILLED), np.nan)


def bounded_noise(parts: Sequence[PreparedStretch], left: Sequence[Array], owner: Sequence[int]) -> dict[int, Array]:
    """Return for each recording the standard deviation of each joint's residual by its median, the larger of its and all's."""
    values = [
        [row[use][:: max(1, len(row) // SCALE_SAMPLES)] for row, use in zip(rows, part.used, strict=True)]
        for rows, part in zip(left, parts, strict=True)
    ]

    def scale(chosen: Sequence[int]) -> Array:
        of_joint = zip(*(values[k] for k in chosen), strict=True)
        together = [np.abs(np.concatenate(own)) for own in of_joint]
        return np.array([NORMAL * median(own) if len(own) else 0.0 for own in together])

    everything = scale(range(len(parts)))
    return {
        k: np.maximum(everything, scale([i for i, own in enumerate(owner) if own == k])) for k in dict.fromkeys(owner)
    }


def binned(recording: int, part: PreparedStretch, left: Array, noise: Array) -> Binned:
    """Return the residual of a stretch, shape (n, N), in bins; what an event left out counts again."""
    size = max(1, round(BIN * part.rate))
    count = part.samples // size
    used = part.used
    if np.any(part.left_out):
        used = ~(standstill(part.stretch, part.motion, part.bands) | part.stretch.clipped)
        used[:, : part.trim] = used[:, max(part.trim, part.samples - part.trim) :] = False
    motion, middle = part.motion, slice(size // 2, count * size, size)
    speed = np.abs(motion.v)
    used = (used & (speed > MIN_SPEED_SHARE * np.max(speed, axis=1, keepdims=True)))[:, : count * size]
    signals = (motion.q, motion.v, motion.a, part.torque - left)
    q, v, a, load = (row[:, middle] for row in signals)
    return Binned(recording, part, size, left[:, : count * size], used, noise, (q, v, a, load), np.zeros_like(q))


def _bin_means(signals: Array, size: int) -> Array:
    """Return the mean over each bin of so many samples, shape (n, M); as a product, a quarter of the time of `numpy.mean`."""
    return np.asarray(signals.reshape(len(signals), -1, size) @ np.ones(size) / size)


def _up_to_each(signal: Array) -> Array:
    return np.concatenate([np.zeros((len(signal), 1)), np.cumsum(signal, axis=1)], axis=1)
