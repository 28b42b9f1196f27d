"""Begin and end of an event, by likelihood.

First where the variance is larger between them than outside; then each end again, by where the mean stops being what it is
within, or what a constant force at the tool makes of it along the motion. There a joint that turns slowly counts as far as its
residual is usually small then. While the whole arm stands still the torque steps where a push begins or ends, beside a friction that is constant and not known.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array, runs_of

# How far an event may reach to either side of what stands out most, s.
REACH_SECONDS = 5.0
# What comes so much later, s, is something else.
GAP = 0.6
# Its ends are looked for again between so long within and so long beyond them, s, in which something is seen.
EDGE = (0.3, 0.6)
# The torque of a joint at rest is off by no more than an event's step by this factor, and so many standard deviations of bins.
LARGEST_STEP, LOOSE = 2.0, 4.0
# What has under this share of the power that an event has at its strongest, after that, is what friction keeps of it or none of it.
WEAK = 0.1
# An end is stated to lie within the bins that hold so much of its likelihood, and one on either side, which it may cut.
INTERVAL_LEVEL = 0.95


@dataclass(frozen=True)
class Ends:
    """Where an event lies.

    Attributes
    ----------
    start, stop : int
        First bin, and the first one after it.
    begins, ends : tuple of int
        The least and the largest that each of them may be.
    """

    start: int
    stop: int
    begins: tuple[int, int]
    ends: tuple[int, int]


def event_ends(
    relative: Array,
    trust: Array,
    still: Array,
    free: NDArray[np.bool_],
    window: slice,
    shows: NDArray[np.bool_],
    width: float,
    shape: Callable[[int, int], Array | None] = lambda start, stop: None,
) -> Ends:
    """Find where an event begins and ends.

    Parameters
    ----------
    relative : ndarray, shape (n, M)
        Residual over the noise of its bins.
    trust : ndarray, shape (n, M)
        Weight of bins: 1 where a joint moves, less where it turns slowly, 0 where a bin says nothing.
    still : ndarray, shape (n, M)
        The same while the whole arm stands still; NaN where it moves.
    free : ndarray of bool, shape (M,)
        Bins of no other event.
    window : slice
        Bins that stand out most.
    shows : ndarray of bool, shape (n,)
        Joints that help to find the ends.
    width : float
        Length of a bin, s.
    shape : callable, optional
        What it would be in every bin, shape (n, M), of an event from a bin to before another; None where nobody can say.
    """
    own = np.where(trust[shows] >= 1.0, relative[shows], 0.0)
    power = np.maximum(np.mean(own[:, window] ** 2, axis=1), 2.0)
    # Of log variance: what is between the ends has the power of the window, what is outside has 1.
    value = np.minimum(own**2, 4.0 * power[:, None])
    likelihood = np.sum(0.5 * (value * (1.0 - 1.0 / power[:, None]) - np.log(power[:, None])), axis=0)
    likelihood[~free] = -np.inf
    middle, reach = (window.start + window.stop) // 2, int(REACH_SECONDS / width)
    before = np.cumsum(likelihood[max(0, middle - reach) : middle + 1][::-1])
    after = np.cumsum(likelihood[middle : middle + reach])
    gap = round(GAP / width)
    start = middle - _first_peak(before, gap)
    stop = middle + _first_peak(after, gap) + 1
    # Nothing of it is in another event.
    open_ = np.where(free, relative, 0.0)
    near, far = (round(seconds / width) for seconds in EDGE)
    trust = np.where(free, trust, 1.0)

    def again(start: int, stop: int, shape: Array | None) -> Ends:
        parts = (open_, trust, still, *(() if shape is None else (shape,)))
        back, least, most = _lasting([part[:, :stop][:, ::-1] for part in parts], stop - start, near, far)
        start, begins = stop - back, (stop - most, stop - least)
        on, least, most = _lasting([part[:, start:] for part in parts], stop - start, near, far)
        return Ends(start, start + on, begins, (start + least, start + most))

    strong = np.sum(trust * open_**2, axis=0)
    stop = start + _strong(strong[start:stop], near)
    start = stop - _strong(strong[start:stop][::-1], near)
    found = again(start, stop, None)
    expected = shape(found.start, found.stop)
    return found if expected is None else again(found.start, found.stop, expected)


def _first_peak(likelihood: Array, gap: int) -> int:
    """Return the place of the first value that no value exceeds within so many places after it."""
    best = 0
    for place, value in enumerate(likelihood.tolist()):
        if place - best > gap:
            break
        best = place if value > likelihood[best] else best
    return best


def _strong(power: Array, near: int) -> int:
    """Return how many bins of an event, by their power, there are up to the last that is not weak beside its strongest part."""
    wide = min(near, len(power))
    strongest = float(np.max(np.convolve(power, np.full(wide, 1.0 / wide), mode="valid")))
    return int(np.flatnonzero(power >= WEAK * strongest)[-1]) + 1


def _lasting(parts: Sequence[Array], length: int, near: int, far: int) -> tuple[int, int, int]:
    """Return how many bins from the first on a shift lasts, which is known to last about so many, and at least and at most.

    ``parts`` are residual, trust, what is left at rest, and the shift where one is expected; by default, and on joints where that
    makes the residual larger, it is the mean shortly before the end. A joint that shows nothing counts for nothing.
    """
    relative, trust, still = parts[:3]
    first = max(0, length - near)
    # So many bins further that say something.
    seen = np.cumsum(np.max(trust[:, length:], axis=0, initial=0.0))
    last = length + int(np.searchsorted(seen, far, side="right"))
    # Where it surely is, or of a short one where it may end.
    sure = slice(max(0, first - near), first) if first >= near else slice(first, length)
    inside, weight = slice(first, last), trust[:, sure]
    mean = np.sum(weight * relative[:, sure], axis=1) / np.maximum(np.sum(weight, axis=1), 1e-300)
    shift = np.repeat(mean[:, None], last - first, axis=1)
    if len(parts) > 3:
        # A force that is determined by other joints may be wrong about one.
        of_shape = parts[3][:, sure]
        agrees = np.sum(weight * (2.0 * relative[:, sure] - of_shape) * of_shape, axis=1) >= 0.0
        shift[agrees] = parts[3][agrees, inside]
    gain = np.cumsum(np.sum(trust[:, inside] * (2.0 * relative[:, inside] * shift - shift**2), axis=0))
    gain += _at_rest(still[:, inside], shift)
    best = int(np.argmax(gain))
    # Between bins that say something the middle is as good as any.
    as_good = int(np.argmin(np.append(gain[best:] == gain[best], False)))
    likely = np.cumsum(np.exp(0.5 * (gain - gain[best])))
    least, most = np.searchsorted(
        likely, np.array([0.5 - 0.5 * INTERVAL_LEVEL, 0.5 + 0.5 * INTERVAL_LEVEL]) * likely[-1]
    ).tolist()
    lasts = first + best + 1 + as_good // 2
    return lasts, min(first + least, lasts), max(first + most + 2, lasts)


def _at_rest(still: Array, shift: Array) -> Array:
    """Return the likelihood that the shift ends after each bin of a rest, against none in that rest, (M,)."""
    found = np.zeros(still.shape[1])
    for begin, end in runs_of(np.any(np.isfinite(still), axis=0)):
        # Nothing moves: it is the same all along.
        mean = shift[:, begin : begin + 1]
        left = still[:, begin:end] - np.median(still[:, begin:end], axis=1, keepdims=True)
        # What is larger is friction that comes or goes.
        use = (np.abs(left) <= LARGEST_STEP * np.abs(mean) + LOOSE).astype(float)
        before, whole = np.cumsum(use, axis=1), np.maximum(np.sum(use, axis=1, keepdims=True), 1.0)
        left = np.where(use > 0.0, left, 0.0)
        left = use * (left - np.sum(left, axis=1, keepdims=True) / whole)
        up, parted = np.cumsum(left, axis=1), before * (whole - before) / whole
        gain = 2.0 * mean * up - mean**2 * parted
        # What one step does not explain is how constant friction is there.
        by_step = np.max(up**2 / np.where(parted > 0.0, parted, np.inf), axis=1, keepdims=True)
        gain /= np.maximum((np.sum(left**2, axis=1, keepdims=True) - by_step) / whole, 1.0)
        found[begin:end] = np.sum(gain, axis=0)
    return found
