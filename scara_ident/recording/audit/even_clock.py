"""Even clocks under the stamps of a recording: when its samples may have been taken, lost ones counted.

The stamps alone tell an even clock where few samples are lost. Where many are, the positions do: the way of all joints in a
step, at the speed that they have over the samples around it, is that of one interval or of several.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import NORMAL_MEDIAN, Array
from scara_ident.recording.audit.samples import GAP_STEPS, Samples

# Samples on either side over which the even clock is the median of the stamps, and over which a lost sample shows.
MEDIAN_REACH, LOST_REACH = 50, 4
# Of fewer samples than twice that reach and more no even clock is found.
MIN_SAMPLES = 4 * MEDIAN_REACH
# An interval over so few samples is that of a step where few are lost; over many it is known better.
NEARBY = 10
# It is longer than the usual step by more than this where many are lost; jitter moves the usual step by less.
SAME_INTERVAL = 0.03
# Samples on either side of a step over which the speed in it is taken. A late stamp is a small share of their time, and
# the speed bends little.
SPEED_ROWS = 4
# A step says how long it is where its speed is above this share of the usual one.
MOVING_SHARE = 0.2
# How many intervals a step has is known where its length is to this share of an interval (std): the next number is ten of
# these away.
KNOWN_STD = 0.1
# No step is of no interval: where this share seems to be, the way is one of an encoder's coarse steps or none.
NO_WAY = 0.01
# Speeds by the stamps tell the intervals, these tell better speeds; the third time little changes any more.
ROUNDS = 3


def even_clocks(samples: Samples) -> list[Array]:
    """Return even clocks by which the samples may have been taken, as near as can be to the stamps.

    Parameters
    ----------
    samples : Samples
        At least `MIN_SAMPLES` of them, in order of time.

    Returns
    -------
    list of ndarray, shape (N,)
        Times in s by the stamps and by the positions; what cannot be found is missing.
    """
    time, clocks = samples.time, []
    usual = _midmean(np.diff(time))
    near = float(np.median(time[NEARBY:] - time[:-NEARBY])) / NEARBY
    if abs(near / usual - 1.0) < SAME_INTERVAL:
        one = np.ones(samples.count - 1)
        clocks.append(_clock(time, _interval(time, near), one, one < 1.0))
    by_positions = _by_positions(samples, usual)
    if by_positions is not None:
        steps, determined = by_positions
        count = np.concatenate([[0.0], np.cumsum(steps)])
        over_many = (time[2 * MEDIAN_REACH :] - time[: -2 * MEDIAN_REACH]) / (
            count[2 * MEDIAN_REACH :] - count[: -2 * MEDIAN_REACH]
        )
        clocks.append(_clock(time, float(np.median(over_many)), steps, determined))
    return clocks


def _midmean(values: Array) -> float:
    """Return the mean of the middle half: a median of what is rounded to a few values is one of these."""
    quarter = len(values) // 4
    return float(np.mean(np.sort(values)[quarter : len(values) - quarter]))


def _clock(time: Array, interval: float, steps: Array, determined: NDArray[np.bool_]) -> Array:
    """Return even times of samples so many intervals apart or, where that is not determined and the stamps do, more."""
    from scipy.ndimage import median_filter, minimum_filter1d, uniform_filter1d

    count = np.concatenate([[0.0], np.cumsum(steps)])
    ahead = (time - time[0]) / interval - count
    # Beyond its ends the recording goes on as there: so a gap behind its first sample is one.
    ahead = median_filter(ahead, 2 * LOST_REACH + 1, mode="nearest")
    # What is late for a while comes back; what is lost stays.
    lost = _lost(minimum_filter1d(ahead, MEDIAN_REACH, mode="nearest", origin=-(MEDIAN_REACH // 2)), determined)
    even = interval * (count + lost)
    # A clock that drifts is even all the same, and behind a gap it starts anew.
    edges = np.flatnonzero(np.diff(lost) >= GAP_STEPS - 1.0) + 1
    off = [median_filter(part, 2 * MEDIAN_REACH + 1, mode="mirror") for part in np.split(time - even, edges)]
    smooth = [uniform_filter1d(part, 2 * MEDIAN_REACH + 1, mode="mirror") for part in off]
    return np.asarray(even + np.concatenate(smooth))


def _interval(time: Array, near: float) -> float:
    """Return the interval of samples of which few are lost."""
    interval = near
    for reach in (2 * NEARBY, 4 * NEARBY, 2 * MEDIAN_REACH):
        way = time[reach:] - time[:-reach]
        # Over more samples it is known better; over fewer it was known well enough to see lost ones among these.
        interval = float(np.median(way / np.maximum(reach, np.rint(way / interval))))
    return interval


def _lost(ahead: Array, determined: NDArray[np.bool_]) -> Array:
    """Return how many samples were lost before each, by how far stamps are ahead, in intervals, where it is not `determined`."""
    lost, level = np.zeros(len(ahead)), float(ahead[0])
    total, free = 0.0, [False, *(~determined).tolist()]
    for k, value in enumerate(ahead.tolist()):
        jump = round(value - level - total)
        if jump > 0 and free[k]:
            total += jump
        level += (value - total - level) / MEDIAN_REACH
        lost[k] = total
    return lost


def _by_positions(samples: Samples, usual: float) -> tuple[Array, NDArray[np.bool_]] | None:
    """Return how many intervals each step has by the way of the joints in it.

    Parameters
    ----------
    samples : Samples
        The samples under their stamps.
    usual : float
        The usual step of the stamps, s.

    Returns
    -------
    steps : ndarray, shape (N - 1,)
        The number; 1 where the joints do not tell.
    determined : ndarray of bool, shape (N - 1,)
        Where they do. None is returned where they do not in most steps in which they move.
    """
    position = samples.position[~samples.idle()]
    if not len(position):
        return None
    stamped = np.diff(samples.time)
    inner = np.arange(SPEED_ROWS, samples.count - 1 - SPEED_ROWS)
    before, after = inner - SPEED_ROWS, inner + 1 + SPEED_ROWS
    way = np.diff(position, axis=1)[:, inner]
    weight = 1.0 / np.mean(way**2, axis=1, keepdims=True)
    # Over a gap no speed is known.
    gap = np.convolve(stamped > GAP_STEPS * usual, np.ones(2 * SPEED_ROWS + 1), "same")[inner] > 0.0
    if gap.all():
        return None
    time = samples.time
    for _ in range(ROUNDS):
        speed = (position[:, after] - position[:, before]) / (time[after] - time[before])
        size = np.sum(weight * speed**2, axis=0)
        moving = ~gap & (size > MOVING_SHARE**2 * float(np.mean(size, where=~gap)))
        if np.count_nonzero(moving) < MIN_SAMPLES:
            return None
        length = np.sum(weight * speed * way, axis=0) / np.maximum(size, np.finfo(float).tiny)
        interval = _midmean(length[moving])
        if interval <= 0.0:
            return None
        intervals = length / interval
        off = np.abs(intervals - np.rint(intervals)) * np.sqrt(size)
        known = moving & (float(np.median(off[moving])) / NORMAL_MEDIAN < KNOWN_STD * np.sqrt(size))
        none = known & (intervals < 0.5)
        if 2 * np.count_nonzero(known) < np.count_nonzero(moving) or np.mean(none[known]) > NO_WAY:
            return None
        steps, determined = np.ones(len(stamped)), np.zeros(len(stamped), dtype=bool)
        steps[inner[known]] = np.maximum(1.0, np.rint(intervals[known]))
        # Where the joints do not tell, the stamps are what is known.
        determined[inner[known]] = True
        time = np.concatenate([[0.0], np.cumsum(np.where(determined, steps * usual, stamped))])
    return steps, determined
