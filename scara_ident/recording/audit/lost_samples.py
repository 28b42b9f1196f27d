"""Samples lost under a clock that was made even afterwards: all joints jump ahead by the way of a sample."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from scara_ident.arrays import NORMAL_MEDIAN, Array
from scara_ident.manners import several
from scara_ident.recording.audit.samples import Checked, Finding, Samples, resolution

# Samples on either side of a step that a parabola with a jump at the step is fitted to.
SIDE = 3
# A joint says something where its speed is above this share of its rms speed.
MOVING_SHARE = 0.2
# Fewer such samples do not tell how large its jumps are without a loss; nor fewer judged steps how often there is one.
MIN_SAMPLES = 200
# A step is judged where the samples missing in it are known to so many (std), and some are missing from here on: of one,
# nearer to one than to none by two of these; and where the arm is slow against the noise, of many by five.
LEVELS = ((0.1, 0.7), (0.5, 3.0))
# A source that was late jumps back as far as ahead; lost samples ahead alone.
AHEAD = 5.0
# The fit two steps beside a jump has one back of 0.42 of its size.
SHADOW = 0.6
# So many samples that are usually lost at once are reported: such a log waits for something now and then, as for a plot.
SEVERAL = 2
# Beyond this share of the steps, or of the samples, velocities and accelerations are not those of the arm; below it, it is said ...
MAX_LOST_SHARE = 0.01
# ... from this share on, and from so many.
MIN_LOST_SHARE, MIN_LOST = 1e-3, 3
# A step in time that differs from the median by more than this share is one that the clock tells itself.
EVEN_SHARE = 0.3
# Rounding of positions, as a share of the way of the fastest sample.
ROUNDING = 1e-4
# Std of the rounding to an encoder's steps, as a share of one step: that of a uniform distribution.
ROUNDING_STD = 12.0**-0.5
# A jump ahead counts if it is this many times the std that follows from the residual of its fit. At a sharp turn the residual is large.
CLEAR = 4.0


def restamped(samples: Samples) -> Checked:
    """Refuse a recording in which many samples are lost that the clock does not show; say it of few."""
    if samples.count < MIN_SAMPLES:
        return samples, []
    missing, std = _missing(samples)
    for known, least in LEVELS:
        found = _judged(samples, np.where(std < known, missing, np.nan), least)
        if found is not None:
            return samples, [found]
    return samples, []


def _judged(samples: Samples, missing: Array, least: float) -> Finding | None:
    """Say what is lost where so many samples are missing in each step, shape (N - 1,), NaN where that is not known."""
    total = int(np.count_nonzero(np.isfinite(missing)))
    ahead, back = ((sign * missing > least) & ~_shadows(sign * missing) for sign in (1.0, -1.0))
    # A late sample jumps back, and the next one ahead by as much.
    count = int(np.count_nonzero(ahead)) - int(np.count_nonzero(back))
    lost, late = float(np.sum(missing[ahead])), -float(np.sum(missing[back]))
    share, gone = count / max(total, 1), (lost - late) / max(total, 1)
    if total < MIN_SAMPLES or count < max(MIN_LOST, MIN_LOST_SHARE * total) or lost < AHEAD * late:
        return None
    usual = round(float(np.median(np.sort(missing[ahead])[np.count_nonzero(back) :])))
    what = (
        f"samples are lost, but the clock is even (made afterwards): "
        f"{'all joints jump' if len(samples.position) > 1 else 'the joint jumps'} ahead by the way of "
        f"{'a sample or more' if usual < SEVERAL else f'about {usual} samples'} in {100 * share:.2g} % of the steps in motion, "
        f"first before {samples.where(int(np.argmax(ahead)) + 1)}, and in all about {float(f'{100 * gone:.2g}'):g} are missing "
        "for every 100 recorded"
    )
    if max(share, gone) > MAX_LOST_SHARE:
        samples.refuse(f"{what}; record again, with the time at which each sample was taken")
    return Finding("restamped", f"{what}: used as it is ({several(count, 'jump')})", count)


def _missing(samples: Samples) -> tuple[Array, Array]:
    """Estimate how many samples are missing in each step, and their std, shapes (N - 1,); NaN where nothing tells it.

    A sample that is missing shifts what comes after by the way of one step. Of every joint the jump and the way of a step
    come from the same fit, and where the jump is in its middle the way has nothing of it; each joint counts by how large its way is against the jumps that it usually shows.
    """
    place = np.arange(0.5 - SIDE, SIDE)
    fit = np.linalg.pinv(np.column_stack([np.ones_like(place), place, place**2, place > 0]))
    window = sliding_window_view(samples.position, 2 * SIDE, axis=1)
    way, jump = window @ fit[1], window @ fit[3]
    noise, beside = float(np.linalg.norm(fit[3])), np.linalg.svd(fit)[2][len(fit) :]
    rest = np.linalg.norm(window @ beside.T, axis=2) / len(beside) ** 0.5
    moving = np.abs(way) > MOVING_SHARE * np.sqrt(np.mean(_undisturbed(way) ** 2, axis=1, keepdims=True))
    weight, idle = np.zeros_like(way), samples.idle()
    for j, inside in enumerate(moving):
        # Of a joint that stands still all is rounding.
        if np.count_nonzero(inside) >= MIN_SAMPLES and not idle[j]:
            # Losses within less than half of the windows leave it alone.
            usual = float(np.median(np.abs(jump[j, inside]))) / NORMAL_MEDIAN
            floor = ROUNDING * float(np.max(np.abs(way[j])))
            # At constant speed most steps of a coarse encoder are equal: the usual jump is then smaller than its rounding.
            rounded = resolution(samples.position[j]) * ROUNDING_STD * noise
            weight[j, inside] = 1.0 / max(usual, floor, rounded) ** 2
    jump[(way * jump > 0.0) & (np.abs(jump) < CLEAR * noise * rest)] = 0.0
    known = np.sum(weight * way**2, axis=0)
    missing, std = np.full((2, samples.count - 1), np.nan)
    determined = (known > 0.0) & _even(samples)
    inner = slice(SIDE - 1, samples.count - SIDE)
    missing[inner][determined] = np.sum(weight * way * jump, axis=0)[determined] / known[determined]
    std[inner][determined] = known[determined] ** -0.5
    return missing, std


def _undisturbed(way: Array) -> Array:
    """Return how far each step goes, shape (n, M), without what a jump beside its middle adds: the least way around it."""
    around = sliding_window_view(np.pad(np.abs(way), ((0, 0), (SIDE - 1, SIDE - 1)), mode="edge"), 2 * SIDE - 1, axis=1)
    return np.asarray(np.min(around, axis=2))


def _shadows(missing: Array) -> NDArray[np.bool_]:
    """Tell which steps jump ahead only as far as the fit there does that shares most of its samples with one that jumps back.

    With the signs exchanged, two such steps beside three samples lost at once were as many late ones.
    """
    back = np.maximum(-np.nan_to_num(missing), 0.0)
    around = np.max(sliding_window_view(np.pad(back, SIDE - 1), 2 * SIDE - 1), axis=1)
    return np.asarray(missing < SHADOW * around)


def _even(samples: Samples) -> NDArray[np.bool_]:
    """Tell in which windows of samples the clock is even, shape (N - 2 SIDE + 1,)."""
    step = np.diff(samples.time)
    uneven = np.abs(step - samples.interval) > EVEN_SHARE * samples.interval
    return np.asarray(~np.any(sliding_window_view(uneven, 2 * SIDE - 1), axis=1))
