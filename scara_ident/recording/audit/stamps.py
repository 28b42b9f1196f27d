"""Time stamps beside the positions: samples that are even under stamps that are not, and rows that all but coincide.

A log often stamps a sample when it arrives. The positions tell: under the right times each lies on the polynomial through
its neighbours, under others it lies off by the way that the joint makes in the error.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.manners import several
from scara_ident.recording.audit.even_clock import MEDIAN_REACH, MIN_SAMPLES, even_clocks
from scara_ident.recording.audit.samples import GAP_STEPS, Checked, Finding, Samples

# A stamp is off an even clock from this share of the interval on.
OFF = 0.05
# The misfit under even times is below this share of that under the stamps: by chance both are as large.
BETTER_RATIO = 0.5
# A misfit counts up to so many times the usual one: where stamps all but coincide it knows no bounds.
MAX_MISFIT = 100.0
# Even times are refused for a stretch in which the stamps fit better with less chance than this over all stretches.
MAX_CHANCE = 0.01
# Fewer rows of moving joints say nothing.
MIN_ROWS = 5
# A joint moves where it goes this share of its rms way over five samples.
MOVING_SHARE = 0.2
# A step below this share of the interval lies within the noise of the clock, and differences over it are noise.
COINCIDING = 0.1


def late_stamps(samples: Samples) -> Checked:
    """Take the samples as even where the positions say that only their stamps are not."""
    step = np.diff(samples.time)
    if samples.count < MIN_SAMPLES or np.max(np.abs(step - samples.interval)) <= OFF * samples.interval:
        return samples, []
    judged = [(_evener(samples, even), even) for even in even_clocks(samples)]
    share, even = min(judged, key=lambda item: item[0], default=(np.inf, samples.time))
    if share > BETTER_RATIO:
        return samples, []
    off = np.abs(samples.time - even) > OFF * samples.interval
    count, worst = int(np.count_nonzero(off)), float(np.max(np.abs(samples.time - even)))
    first = samples.where(int(np.argmax(off)))
    said = (
        f"the time stamps of {several(count, 'row')} differ by up to {1e3 * worst:.3g} ms from an even clock, first in "
        f"{first}, but the positions do not: the samples are taken as even"
    )
    return replace(samples, time=even), [Finding("late_stamps", said, count)]


def coinciding(samples: Samples) -> Checked:
    """Keep the first of rows whose stamps all but coincide."""
    near = np.concatenate([[False], np.diff(samples.time) < COINCIDING * samples.interval])
    if not np.any(near):
        return samples, []
    count, first = int(np.count_nonzero(near)), samples.where(int(np.argmax(near)))
    said = (
        f"{several(count, 'row')} follow{'s' if count == 1 else ''} the one before within {COINCIDING:.0%} of the sampling "
        f"interval, first {first}: left out"
    )
    return samples.kept(~near), [Finding("coinciding", said, count)]


def _evener(samples: Samples, even: Array) -> float:
    """Return the misfit of the positions under even times as a share of that under the stamps, where these differ.

    It is infinite where nothing tells, and where the stamps fit better somewhere: there the clock is not the samples'.
    """
    off = np.abs(samples.time - even) > OFF * samples.interval
    if not np.any(off) or np.min(np.diff(even)) <= 0.0:
        return np.inf
    stencil = np.convolve(off, np.ones(5), "same") > 0.0
    gap = np.diff(even, prepend=even[0]) > GAP_STEPS * samples.interval
    whole = np.convolve(gap, np.ones(5), "same") == 0.0
    used = np.flatnonzero((stencil & whole)[2:-2])
    by_stamp, by_even = np.zeros(samples.count), np.zeros(samples.count)
    for position in samples.position[~samples.idle()]:
        # A joint that stands still says nothing.
        way = np.abs(position[4:] - position[:-4])
        moving = used[way[used] > MOVING_SHARE * np.sqrt(np.mean(way**2))]
        if len(moving) < MIN_ROWS:
            continue
        misfits = [_misfit(time, position, moving) for time in (samples.time, even)]
        usual = min(float(np.median(item)) for item in misfits)
        if usual > 0.0:
            for total, item in zip((by_stamp, by_even), misfits, strict=True):
                total[moving] += np.minimum(item / usual, MAX_MISFIT)
    if not np.any(by_stamp):
        return np.inf
    if _stamped_somewhere(by_stamp, by_even, off):
        return np.inf
    return float(np.sum(by_even) / np.sum(by_stamp))


def _stamped_somewhere(by_stamp: Array, by_even: Array, off: NDArray[np.bool_]) -> bool:
    """Return whether the stamps fit better than even times in a stretch, and by more than chance makes in one of so many.

    All misfits about a stamp are of one error of its time, so that a stretch has as many degrees of freedom as stamps that
    are off.
    """
    stretches = np.arange(0, len(off), 2 * MEDIAN_REACH)
    stamp, even, count = (np.add.reduceat(item, stretches) for item in (by_stamp, by_even, off.astype(float)))
    better = np.flatnonzero((BETTER_RATIO * even > stamp) & (count > 0.0))
    if not len(better):
        return False
    from scipy.special import fdtrc

    ratio = even[better] / np.maximum(stamp[better], np.finfo(float).tiny)
    chance = fdtrc(count[better], count[better], ratio) * np.count_nonzero(count)
    return bool(np.min(chance) < MAX_CHANCE)


def _misfit(time: Array, position: Array, used: NDArray[np.intp]) -> Array:
    """Return the squared distance of positions from the cubic through two neighbours on either side, shape (rows,)."""
    around = [used, used + 1, used + 3, used + 4]
    times, here = [time[place] for place in around], time[used + 2]
    found = position[used + 2].copy()
    for k, place in enumerate(around):
        weight = np.ones(len(used))
        for other, own in enumerate(times):
            if other != k:
                weight *= (here - own) / (times[k] - own)
        found -= weight * position[place]
    return np.asarray(found**2)
