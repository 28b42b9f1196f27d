"""How well torque repeats: the noise floor, from repetitions of one trajectory."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.arrays import Array
from scara_ident.motion.motion import Stretch, torque_of
from scara_ident.motion.prepared import PreparedData

# Repetitions start within this many seconds of each other after alignment; more is another motion.
LARGEST_SHIFT = 1.0
# Aligned positions that differ by more than this share of their range are not the same motion.
SAME_MOTION = 0.01
# Sample rates that differ by more than this share are not compared sample by sample.
SAME_RATE = 1e-3


def repeatability(data: PreparedData) -> dict[str, Array]:
    """Standard deviation of each joint's torque over the repetitions of each trajectory.

    The sigma of Indri et al. (2002, Table 1): repetitions are aligned in time by their positions, and the
    scatter of the torque about its mean over repetitions is pooled over time.

    Parameters
    ----------
    data : PreparedData
        In any bands.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        By trajectory, for those with at least two repetitions of the same motion.
    """
    groups: dict[str, list[Stretch]] = {}
    for item in data.recordings:
        if item.recording.effort is not None:
            groups.setdefault(item.trajectory, []).append(item.longest.stretch)
    found = {}
    for trajectory, group in groups.items():
        sigma = _scatter(group) if len(group) > 1 else None
        if sigma is not None:
            found[trajectory] = sigma
    return found


def _scatter(longest: Sequence[Stretch]) -> Array | None:
    """Scatter about the mean of the repetitions of the first motion that has any."""
    for place, first in enumerate(longest[:-1]):
        aligned = [(torque_of(first), 0)]
        for other in longest[place + 1 :]:
            if abs(other.rate / first.rate - 1.0) > SAME_RATE:
                continue
            shift = alignment(first.position, other.position, round(LARGEST_SHIFT * first.rate))
            if shift is not None:
                aligned.append((torque_of(other), shift))
        # The samples that all of them have.
        start = max(shift for _, shift in aligned)
        stop = min(torque.shape[1] + shift for torque, shift in aligned)
        if len(aligned) > 1 and start < stop:
            stack = np.array([torque[:, start - shift : stop - shift] for torque, shift in aligned])
            return np.asarray(np.sqrt(np.mean(np.var(stack, axis=0, ddof=1), axis=1)))
    return None


def alignment(reference: Array, other: Array, largest: int) -> int | None:
    """Samples by which ``other`` must move to lie on ``reference``, None if it is another motion."""
    length = min(reference.shape[1], other.shape[1])
    if length < 4:
        return None
    largest = min(largest, length // 4)
    core = slice(largest, length - largest)
    scale = np.maximum(np.ptp(reference, axis=1), 1e-12)
    # The mean squared distance over the shifts by FFT: |x|^2 + |y|^2 - 2 x.y.
    best, distance = 0, np.inf
    weight = reference[:, core] / scale[:, None]
    size = weight.shape[1]
    whole = other[:, :length] / scale[:, None]
    cross = np.zeros(2 * largest + 1)
    for x, y in zip(weight, whole, strict=True):
        padded = 1 << (length + size).bit_length()
        product = np.fft.irfft(np.fft.rfft(y, padded) * np.conj(np.fft.rfft(x, padded)), padded)
        square = np.concatenate([[0.0], np.cumsum(y**2)])
        starts = np.arange(2 * largest + 1)
        cross += np.sum(x**2) + square[starts + size] - square[starts] - 2.0 * product[starts]
    best = int(np.argmin(cross))
    distance = float(np.sqrt(max(cross[best], 0.0) / (size * len(scale))))
    return largest - best if distance < SAME_MOTION else None
