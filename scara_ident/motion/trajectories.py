"""Which recordings are repetitions of one trajectory: those of the same motion, whatever they are named.

Positions are laid on each other, moved in time by up to a second. A name says what a trajectory is called, and where names
and motions contradict each other a note says so.
"""

from __future__ import annotations

from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.motion.motion import Stretch
from scara_ident.motion.periods import FINE_RATE, MIN_RANGE_SHARE, SAME_MOTION, at_rate

# Repetitions start within this many seconds of each other after alignment; more is another motion.
LARGEST_SHIFT = 1.0
# Sample rates that differ by more than this share are not compared sample by sample.
SAME_RATE = 1e-3
# A run shorter than this share of another says too little of whether it is its motion, ...
MIN_LENGTH_SHARE = 0.5
# ... as do parts that hold less than this share of the range of every joint: at rest all runs are alike.
MIN_MOVED_SHARE = 0.5
# Most motions are told apart at so few samples per second already, where a shift is known to half a sample only and so much
# of their range is no difference yet.
COARSE_RATE = 10.0
COARSELY_SAME = 0.1


@dataclass(frozen=True)
class Trajectories:
    """Trajectories of recordings.

    Attributes
    ----------
    labels : tuple of str
        Of each recording; the same for repetitions of one motion.
    notes : tuple of str
        Where names and motions contradict each other.
    """

    labels: tuple[str, ...]
    notes: tuple[str, ...]

    def of(self, places: Sequence[int]) -> Trajectories:
        """Return those of some of the recordings, called as among all."""
        return Trajectories(tuple(self.labels[k] for k in places), ())


def trajectories_of(stretches: Sequence[Stretch]) -> Trajectories:
    """Group recordings by their motion.

    Motions that are the same as a third are one trajectory. It is called by the name that most of its recordings have; of
    several that claim a name the one with most recordings has it, and each of the others is called by its first recording
    in the order of their names.

    Parameters
    ----------
    stretches : sequence of Stretch
        The longest of each recording.
    """
    groups = _groups(stretches)
    wanted = [_common(stretches[k].trajectory for k in group) for group in groups]
    labels = [""] * len(stretches)
    notes = []
    taken: set[str] = set()
    # A name goes to the largest group that wants it; none has it where two are as large.
    order = sorted(range(len(groups)), key=lambda g: (-len(groups[g]), min(stretches[k].name for k in groups[g])))
    for g in order:
        names = sorted(stretches[k].name for k in groups[g])
        competing = [other for other in order if other != g and wanted[other] == wanted[g]]
        own = all(len(groups[other]) < len(groups[g]) for other in competing)
        label = wanted[g] if own else names[0]
        while label in taken:
            label += "'"
        taken.add(label)
        for k in groups[g]:
            labels[k] = label
        called = sorted({stretches[k].trajectory for k in groups[g]})
        if len(called) > 1:
            under = "" if called == names else f" under the names {_listed(called)}"
            notes.append(f"{_listed(names)} have the same motion{under}: they count as repetitions")
    for name in sorted({stretch.trajectory for stretch in stretches}):
        place = [k for k, stretch in enumerate(stretches) if stretch.trajectory == name]
        motions = len({labels[k] for k in place})
        if motions > 1:
            runs = _listed(sorted(stretches[k].name for k in place))
            notes.append(f"{runs} are {motions} different motions, so they are not all repetitions of {name}")
    return Trajectories(tuple(labels), tuple(notes))


def _common(names: Iterable[str]) -> str:
    """Return the most frequent name, the first of the alphabet among equals."""
    count = Counter(names)
    return min(count, key=lambda name: (-count[name], name))


def _listed(names: Sequence[str], most: int = 4) -> str:
    return ", ".join(names) if len(names) <= most else f"{names[0]}, {names[1]} ... {names[-1]}"


def _groups(stretches: Sequence[Stretch]) -> list[list[int]]:
    """Return the places of the recordings of each motion."""
    coarse = [at_rate(stretch, COARSE_RATE) for stretch in stretches]
    fine: dict[int, Array] = {}
    group = list(range(len(stretches)))
    # Those of one length are compared with a further one together.
    places = {shape: [k for k, item in enumerate(coarse) if item.shape == shape] for shape in {c.shape for c in coarse}}
    together = {shape: np.array([coarse[k] for k in own]) for shape, own in places.items()}
    for k in range(1, len(stretches)):
        alike = list[int]()
        for shape, own in places.items():
            count = bisect_left(own, k)
            alike += [i for i, same in zip(own, _alike(together[shape][:count], coarse[k]), strict=False) if same]
        for i in sorted(alike):
            if group[i] == group[k]:
                continue
            for place in (i, k):
                if place not in fine:
                    fine[place] = at_rate(stretches[place], FINE_RATE)
            if alignment(fine[i], fine[k], round(LARGEST_SHIFT * FINE_RATE)) is not None:
                old = group[k]
                group = [group[i] if own == old else own for own in group]
    return [[k for k, own in enumerate(group) if own == head] for head in dict.fromkeys(group)]


def _alike(some: Array, other: Array) -> NDArray[np.bool_]:
    """Tell which positions at the coarse rate, shape (k, n, N), may be of the motion of others, shape (n, M)."""
    lengths = some.shape[-1], other.shape[-1]
    if not len(some) or min(lengths) < MIN_LENGTH_SHARE * max(lengths):
        return np.zeros(len(some), dtype=bool)
    distance, _ = _distances(some, other, round(LARGEST_SHIFT * COARSE_RATE))
    return np.asarray(np.min(distance, axis=-1, initial=np.inf) < COARSELY_SAME**2)


def alignment(reference: Array, other: Array, largest: int) -> int | None:
    """Return the samples by which ``other`` must move to lie on ``reference``, None if it is another motion.

    Parameters
    ----------
    reference, other : ndarray, shape (n, N) and (n, M)
        Positions at the same rate.
    largest : int
        Samples by which it may move either way.
    """
    distance, largest = _distances(reference, other, largest)
    if not len(distance):
        return None
    best = int(np.argmin(distance))
    least = float(distance[best])
    if 0 < best < len(distance) - 1:
        # Between samples the motion may lie nearer still: the squared distance is a parabola of the shift.
        before, after = distance[best - 1], distance[best + 1]
        bend = before + after - 2.0 * least
        least -= (before - after) ** 2 / (8.0 * bend) if bend > 0.0 else 0.0
    if least >= SAME_MOTION**2:
        return None
    length = min(reference.shape[-1], other.shape[-1])
    one, two = reference[:, :length], other[:, :length]
    size = length - 2 * largest
    if _holds_motion(one, two, slice(largest, largest + size), slice(best, best + size)):
        return largest - best
    # Without their ends the two are at rest, so that these tell: each shift is judged by all that it lays on each other.
    found, at = SAME_MOTION**2, None
    for shift in range(-largest, largest + 1):
        own, others = slice(max(0, shift), length + min(0, shift)), slice(max(0, -shift), length - max(0, shift))
        apart = float(np.mean(((one[:, own] - two[:, others]) / _ranges(one, two)[:, None]) ** 2))
        if apart < found and _holds_motion(one, two, own, others):
            found, at = apart, shift
    return at


def _ranges(one: Array, two: Array) -> Array:
    """Return the wider range of each joint of two motions, shape (..., n); one that stands still has only noise for it."""
    spread = np.maximum(np.ptp(one, axis=-1), np.ptp(two, axis=-1))
    return np.asarray(np.maximum(spread, np.maximum(MIN_RANGE_SHARE * np.max(spread, axis=-1, keepdims=True), 1e-12)))


def _holds_motion(one: Array, two: Array, own: slice, others: slice) -> bool:
    """Tell whether parts of two motions hold enough of the range of any joint."""
    parts = np.maximum(np.ptp(one[:, own], axis=-1), np.ptp(two[:, others], axis=-1))
    return bool(np.any(parts >= MIN_MOVED_SHARE * _ranges(one, two)))


def _distances(reference: Array, other: Array, largest: int) -> tuple[Array, int]:
    """Return the mean squared distance in shares of the range for every shift, and the largest shift.

    Parameters
    ----------
    reference : ndarray, shape (..., n, N)
        Of one motion, or of several that are as long.
    other : ndarray, shape (n, M)
    """
    from scipy.fft import next_fast_len

    length = min(reference.shape[-1], other.shape[-1])
    if length < 4:
        return np.zeros((*reference.shape[:-2], 0)), 0
    largest = min(largest, length // 4)
    scale = _ranges(reference[..., :length], other[:, :length])[..., None]
    x = reference[..., largest : length - largest] / scale
    y = other[:, :length] / scale
    # By FFT: |x|^2 + |y|^2 - 2 x.y. About a common centre, so that the difference keeps its digits.
    centre = x.mean(axis=-1, keepdims=True)
    x, y = x - centre, y - centre
    size = x.shape[-1]
    starts = np.arange(2 * largest + 1)
    # No shift that is asked for reaches round the end.
    padded = next_fast_len(length, real=True)
    spectrum = np.fft.rfft(y, padded, axis=-1) * np.conj(np.fft.rfft(x, padded, axis=-1))
    product = np.fft.irfft(np.sum(spectrum, axis=-2), padded)[..., starts]
    square = np.cumsum(np.sum(y**2, axis=-2), axis=-1)
    square = np.concatenate([np.zeros((*square.shape[:-1], 1)), square], axis=-1)
    total = np.sum(x**2, axis=(-2, -1))[..., None] + square[..., starts + size] - square[..., starts] - 2.0 * product
    return np.maximum(total, 0.0) / (x.shape[-2] * size), largest
