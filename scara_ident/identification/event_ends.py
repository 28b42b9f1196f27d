"""Where in time what stands out begins and ends, by likelihood.

First where the variance is larger between them than outside; then each end again, by where the mean stops being what it is
within, or what a constant force at the tool makes of it along the motion. There a joint that turns slowly counts as far as its
residual is usually small then. While the whole arm stands still the torque steps where a push begins or ends, beside a friction that is constant and known only as far as rests are alike.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.identification.binned_residual import NORMAL, runs_of

# How far an event may reach to either side of what stands out most, s.
REACH = 5.0
# Its ends are looked for again between so long within and so long beyond them, s, in which something is seen.
EDGE = (0.3, 0.6)
# A step of the torque at rest is bounded at that of the event by this factor, and so many standard deviations of bins.
LARGEST_STEP, LOOSE = 2.0, 4.0
# Twice the logarithm of how much less likely it is to last into a rest: levels there are normal only nearly.
DOUBT = 5.0
# Rests from which it is known how far apart they are.
LEAST_RESTS = 4


def event_ends(
    relative: Array,
    trust: Array,
    still: Array,
    alike: Array,
    free: NDArray[np.bool_],
    window: slice,
    shows: NDArray[np.bool_],
    width: float,
    shape: Callable[[int, int], Array | None] = lambda start, stop: None,
) -> tuple[int, int]:
    """Return the first bin of an event, and the first one after it.

    Parameters
    ----------
    relative : ndarray, shape (n, M)
        Residual over the noise of its bins.
    trust : ndarray, shape (n, M)
        Weight of bins: 1 where a joint moves, less where it turns slowly, 0 where a bin says nothing.
    still : ndarray, shape (n, M)
        The same while the whole arm stands still; NaN where it moves.
    alike : ndarray, shape (n,)
        How far apart rests are in that (see `spread_of_rests`).
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
    middle, reach = (window.start + window.stop) // 2, int(REACH / width)
    before = np.cumsum(likelihood[max(0, middle - reach) : middle + 1][::-1])
    after = np.cumsum(likelihood[middle : middle + reach])
    start = middle - int(np.argmax(before))
    stop = middle + int(np.argmax(after)) + 1
    # Nothing of it is in another event.
    open_ = np.where(free, relative, 0.0)
    near, far = (round(seconds / width) for seconds in EDGE)
    trust = np.where(free, trust, 1.0)

    def again(start: int, stop: int, shape: Array | None) -> tuple[int, int]:
        parts = (open_, trust, still, *(() if shape is None else (shape,)))
        start = stop - _lasting([part[:, :stop][:, ::-1] for part in parts], alike, stop - start, near, far)
        return start, start + _lasting([part[:, start:] for part in parts], alike, stop - start, near, far)

    start, stop = again(start, stop, None)
    expected = shape(start, stop)
    return (start, stop) if expected is None else again(start, stop, expected)


def _lasting(parts: Sequence[Array], alike: Array, length: int, near: int, far: int) -> int:
    """Return how many bins from the first on a shift lasts, which is known to last about so many.

    ``parts`` are residual, trust, what is left at rest, and the shift, by default the mean of each joint shortly before the end;
    a joint that shows nothing counts for nothing.
    """
    relative, trust, still = parts[:3]
    first = max(0, length - near)
    # So many bins further that say something.
    seen = np.cumsum(np.max(trust[:, length:], axis=0, initial=0.0))
    last = length + int(np.searchsorted(seen, far, side="right"))
    inside, weight = slice(first, last), trust[:, first:length]
    mean = np.sum(weight * relative[:, first:length], axis=1) / np.maximum(np.sum(weight, axis=1), 1e-300)
    shift = parts[3][:, inside] if len(parts) > 3 else np.repeat(mean[:, None], last - first, axis=1)
    gain = np.cumsum(np.sum(trust[:, inside] * (2.0 * relative[:, inside] * shift - shift**2), axis=0))
    gain += _at_rest(still[:, inside], alike, shift)
    best = int(np.argmax(gain))
    # Between bins that say something the middle is as good as any.
    as_good = int(np.argmin(np.append(gain[best:] == gain[best], False)))
    return first + best + 1 + as_good // 2


def spread_of_rests(still: Sequence[Array]) -> Array:
    """Return how far apart rests are in what is left of the torque there, shape (n,); infinite where they are too few.

    Parameters
    ----------
    still : sequence of ndarray, each of shape (n, M)
        Of every stretch, NaN where the arm moves.
    """
    levels = [
        np.median(item[:, begin:end], axis=1)
        for item in still
        for begin, end in runs_of(np.all(np.isfinite(item), axis=0))
    ]
    if len(levels) < LEAST_RESTS:
        return np.full(len(still[0]), np.inf)
    return np.asarray(NORMAL * np.median(np.abs(levels), axis=0))


def _at_rest(still: Array, alike: Array, shift: Array) -> Array:
    """Return the likelihood that the shift lasts up to each bin, of the rests up to there, against none in them, (M,).

    What is left in a rest is noise about a level, of which is known that it is normal about zero.
    """
    found = np.zeros(still.shape[1])
    for begin, end in runs_of(np.any(np.isfinite(still), axis=0)):
        count = end - begin
        # Nothing moves: it is the same all along.
        mean = shift[:, begin : begin + 1]
        most = LARGEST_STEP * np.abs(mean) + LOOSE
        level = np.median(still[:, begin:end], axis=1, keepdims=True)
        left = level + np.clip(still[:, begin:end] - level, -most, most)
        # Of the inverse of the covariance, 1 less this share of the mean of all.
        share = (1.0 - 1.0 / (1.0 + count * alike**2))[:, None] / count
        before = np.arange(1, count + 1)
        first = np.cumsum(left, axis=1) - share * np.sum(left, axis=1, keepdims=True) * before
        gain = np.nansum(2.0 * mean * first - mean**2 * (before - share * before**2), axis=0)
        found[begin:end] += gain - DOUBT
        found[end:] += gain[-1] - DOUBT
    return found
