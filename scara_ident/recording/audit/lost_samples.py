"""Samples lost under a clock that was made even afterwards: all joints jump ahead by the way of a sample."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from scara_ident.arrays import NORMAL_MEDIAN, Array
from scara_ident.manners import several
from scara_ident.recording.audit.samples import Checked, Finding, Samples

# Samples on either side of a step that a parabola with a jump at the step is fitted to.
SIDE = 3
# A joint says something where its speed is above this share of its rms speed.
MOVING = 0.2
# Fewer such samples do not tell how large its jumps are without a loss; nor fewer judged steps how often there is one.
ENOUGH = 200
# A step is judged where the samples missing in it are known to this many (std), ...
KNOWN = 0.1
# ... and one is missing from here on: between none and one, nearer to one by two of these.
ONE = 0.7
# A source that was late jumps back as often as ahead; lost samples ahead alone.
AHEAD = 5.0
# Beyond this share of the steps velocities and accelerations are not those of the arm; below it, it is said ...
MOST = 0.01
# ... from this share on, and from so many.
LEAST, FEWEST = 1e-3, 3
# A step in time that differs from the median by more than this share is one that the clock tells itself.
EVEN = 0.3
# Rounding of positions, as a share of the way of the fastest sample.
ROUNDING = 1e-4


def restamped(samples: Samples) -> Checked:
    """Refuse a recording in which many samples are lost that the clock does not show; say it of few."""
    if samples.count < ENOUGH:
        return samples, []
    missing = _missing(samples)
    judged = np.isfinite(missing)
    total = int(np.count_nonzero(judged))
    ahead = missing > ONE
    count = int(np.count_nonzero(ahead))
    share = count / max(total, 1)
    if total < ENOUGH or count < max(FEWEST, LEAST * total) or count < AHEAD * np.count_nonzero(missing < -ONE):
        return samples, []
    first = samples.where(int(np.argmax(ahead)) + 1)
    what = (
        f"samples are lost and the clock was made even over it: all joints jump ahead by the way of a sample or more in "
        f"{100 * share:.2g} % of the steps in which they move, first before {first}"
    )
    if share > MOST:
        samples.refuse(f"{what}; record again, with the time at which each sample was taken")
    return samples, [Finding("restamped", f"{what}: used as it is ({several(count, 'jump')})", count)]


def _missing(samples: Samples) -> Array:
    """Estimate how many samples are missing in each step, shape (N - 1,); NaN where that is not known well.

    A sample that is missing shifts what comes after by the way of one step. Of every joint the jump and the way of a step
    come from the same fit; each joint counts by how large its way is against the jumps that it usually shows.
    """
    place = np.arange(0.5 - SIDE, SIDE)
    fit = np.linalg.pinv(np.column_stack([np.ones_like(place), place, place**2, place > 0]))
    window = sliding_window_view(samples.position, 2 * SIDE, axis=1)
    way, jump = window @ fit[1], window @ fit[3]
    moving = np.abs(way) > MOVING * np.sqrt(np.mean(way**2, axis=1, keepdims=True))
    weight, idle = np.zeros_like(way), samples.idle()
    for j, inside in enumerate(moving):
        # Of a joint that stands still all is rounding.
        if np.count_nonzero(inside) >= ENOUGH and not idle[j]:
            # Losses within less than half of the windows leave it alone.
            usual = float(np.median(np.abs(jump[j, inside]))) / NORMAL_MEDIAN
            floor = ROUNDING * float(np.max(np.abs(way[j])))
            weight[j, inside] = 1.0 / max(usual, floor) ** 2
    known = np.sum(weight * way**2, axis=0)
    judged = (known > KNOWN**-2) & _even(samples)
    missing = np.full(samples.count - 1, np.nan)
    inner = missing[SIDE - 1 : samples.count - SIDE]
    inner[judged] = np.sum(weight * way * jump, axis=0)[judged] / known[judged]
    return missing


def _even(samples: Samples) -> NDArray[np.bool_]:
    """Tell in which windows of samples the clock is even, shape (N - 2 SIDE + 1,)."""
    step = np.diff(samples.time)
    uneven = np.abs(step - samples.interval) > EVEN * samples.interval
    return np.asarray(~np.any(sliding_window_view(uneven, 2 * SIDE - 1), axis=1))
