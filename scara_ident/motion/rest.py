"""Where a joint stands still, so that friction is unknown, and how both sides of its equation fade out towards it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import NORMAL_MEDIAN, Array, median, runs_of
from scara_ident.motion.low_pass import HIGHEST_CUT, low_pass
from scara_ident.motion.motion import Motion, Stretch, motion_of

Bands = Sequence[float | None]

# Positions pass a filter at least three times as wide as the band: inside the band it then changes them by under 2e-4.
POSITION_BAND = 3.0
# A joint stands still where its speed stays below this share of its peak, or below this many standard deviations of its
# velocity's noise: friction is then anything up to Coulomb's. So it is where its encoder makes less than a step in each period of the
# position's low-pass, which lets the steps pass. That low-pass widens it by this many of its periods.
REST_SHARE = 3e-3
REST_NOISE = 5.0
REST_WIDEN = 0.5
# A turn is sharp where the acceleration about it has a range of more than this share of itself beyond the band, where smooth motion
# has none: there friction makes it jump, and the filter moves the turn by a thousandth of the band's period and more.
SHARP = 0.2
# Nor is it known which share of a sample's torque is from before a turn and which from after it. Friction of the wrong sign in one
# sample leaves four times the band over the rate of it: a fifth and more where a period of the band has fewer samples than these.
FEW_SAMPLES = 20.0
# Both sides of the equation fade out towards rest over this many periods of the position's low-pass.
FADE_PERIODS = 1.0
# The noise of an unfiltered joint is what a filter at this share of the rate takes out.
NOISE_CUT_RATIO = 0.2
# Neither is longer than this, s: in a narrow band too little would be left between turning points. So the low-pass of a joint that stands
# and breaks away has no longer period either, as far as the noise of positions leaves what counts as rest as it is.
LONGEST_WIDENING = 0.05


def position_cuts(stretch: Stretch, bands: Bands) -> tuple[float | None, ...]:
    """Return the cut-offs, Hz, of a stretch's positions that go with some bands; None where the least is beyond half the rate.

    One whose period is longer than both sides of the equation fade out rings where a joint breaks away, and gives it a speed while it
    stands: of one that stands for such a period it is raised. The noise of a speed grows with the cut-off to the power
    of 3/2, the speed at which an encoder's steps pass with the cut-off: it is raised as far as leaves both below the share of the peak
    speed that counts as rest.
    """
    least = _narrowest(stretch.rate, bands)
    widest = min(1.0 / LONGEST_WIDENING, HIGHEST_CUT * stretch.rate)
    found = [cut if cut is None else max(cut, widest) for cut in least]
    raised = [joint for joint, cut in enumerate(least) if cut is not None and cut < widest]
    if not raised:
        return tuple(found)
    # Kept, as other bands look at it too.
    motion = motion_of(stretch, found)
    for joint in raised:
        narrow, speed = least[joint] or 0.0, np.abs(motion.v[joint])
        slow = REST_SHARE * float(np.max(speed))
        noise = REST_NOISE * velocity_noise(stretch, motion, joint, bands[joint], slow / REST_NOISE)
        if all(stop - start < stretch.rate / narrow for start, stop in runs_of(speed <= noise)):
            found[joint] = narrow
            continue
        step = (stretch.steps[joint] if stretch.steps else None) or 0.0
        share = min((slow / noise) ** (2.0 / 3.0) if noise > 0.0 else 1.0, slow / (step * widest) if step else 1.0)
        found[joint] = max(narrow, share * widest)
    return tuple(found)


def _narrowest(rate: float, bands: Bands) -> list[float | None]:
    """Return the least cut-offs of positions, Hz."""
    return [
        None if band is None or POSITION_BAND * band > HIGHEST_CUT * rate else POSITION_BAND * band for band in bands
    ]


def standstill(stretch: Stretch, motion: Motion, bands: Bands) -> NDArray[np.bool_]:
    """Return where each joint stands still, shape (n, N), widened by the memory of the position's filter; all of it where it is held.

    So is where it turns sharply, however fast: friction jumps there and the acceleration with it, and the filter, which
    rounds that off, moves the time of the turn. Where samples are few, so is every turn.
    """
    speeds, stepping = rest_speeds(stretch, motion, bands), stepping_speeds(stretch, motion.cuts)
    found = slower(motion.v, speeds, stretch.rate, bands)
    found[stretch.idle] = True
    if np.any(stepping >= speeds):
        # Where steps decide a joint goes to and fro, for half a period of the filter each way, however long that is.
        found |= slower(motion.v, np.where(stepping >= speeds, stepping, -1.0), stretch.rate, bands, longest=np.inf)
    least = _narrowest(stretch.rate, bands)
    for own, v, a, cut, narrow, band in zip(found, motion.v, motion.a, motion.cuts, least, bands, strict=True):
        turns = np.flatnonzero(np.diff(np.signbit(v)) & ~own[:-1]) + 1
        few = band is not None and stretch.rate < FEW_SAMPLES * band
        if not len(turns) or (cut is None and not few):
            continue
        widen = _widening(REST_WIDEN, stretch.rate, band)
        # Beyond an end its own sample again, which widens no range.
        around = np.clip(turns[:, None] + np.arange(-widen, widen + 1), 0, len(v) - 1)
        if not few:
            # Beyond the least cut-off there is more noise than motion.
            slow = a if cut == narrow else low_pass(a, stretch.rate, narrow)
            fast = (slow - low_pass(a, stretch.rate, band))[around]
            sharp = np.ptp(fast, axis=1) > SHARP * np.max(np.abs(a[around]), axis=1)
            around = around[sharp]
        own[around] = True
    return found


def rest_speeds(stretch: Stretch, motion: Motion, bands: Bands) -> Array:
    """Return the speeds below which noise, or a step of its encoder, may be what moves each joint, shape (n,)."""
    least = REST_SHARE / REST_NOISE * np.max(np.abs(motion.v), axis=1)
    # Those that are not filtered pass a wide filter together.
    unfiltered = [j for j, cut in enumerate(motion.cuts) if cut is None]
    stretch.filter_all(dict.fromkeys(unfiltered, NOISE_CUT_RATIO * stretch.rate))
    noise = [velocity_noise(stretch, motion, j, bands[j], least[j]) for j in range(len(bands))]
    # While a joint rests its encoder is silent, and most of a recording may be rest: then that noise is too small.
    return np.maximum(REST_NOISE * np.array(noise), stepping_speeds(stretch, motion.cuts))


def stepping_speeds(stretch: Stretch, cuts: Bands) -> Array:
    """Return the speed of each joint below which its encoder's steps are slower than what passes the filter, shape (n,).

    Steps of size s at the speed v come v/s times a second. Their fundamental has an amplitude of 2 v in the velocity: where the filter
    lets it pass, the joint seems to go to and fro. Zero of a joint whose positions do not go in steps.
    """
    steps = stretch.steps or (None,) * len(cuts)
    return np.array([(step or 0.0) * (cut or 0.5 * stretch.rate) for step, cut in zip(steps, cuts, strict=True)])


def slower(
    v: Array, speeds: Array, rate: float, bands: Bands, *, longest: float = LONGEST_WIDENING
) -> NDArray[np.bool_]:
    """Return where each joint is slower than a speed for some samples, shape (n, N), widened as `standstill`, by so many s at most."""
    found = np.zeros(v.shape, dtype=bool)
    for own, slow, band in zip(found, np.abs(v) <= speeds[:, None], bands, strict=True):
        widen = _widening(REST_WIDEN, rate, band, longest)
        for start, stop in runs_of(slow):
            if stop - start > 1:
                own[max(0, start - widen) : stop + widen] = True
    return found


def fading(rest: NDArray[np.bool_], rate: float, bands: Bands) -> Array:
    """Return the weight of every sample, shape (n, N): 0 at rest, 1 away from it, and between them without a step.

    An equation that holds at every sample holds for both sides times any weight. With the weight zero where friction
    is unknown, the low-pass carries nothing of it to the samples that are used.

    Parameters
    ----------
    rest : ndarray of bool, shape (n, N)
    rate : float
        Samples per second.
    """
    result = np.ones(rest.shape)
    for j, band in enumerate(bands):
        ramp = _widening(FADE_PERIODS, rate, band)
        rise = np.sin(0.5 * np.pi * np.arange(1, ramp + 1) / (ramp + 1)) ** 2
        for start, stop in runs_of(rest[j]):
            before, after = result[j, max(0, start - ramp) : start], result[j, stop : stop + ramp]
            before *= rise[: len(before)][::-1]
            after *= rise[: len(after)]
            result[j, start:stop] = 0.0
    return result


def at_ends(samples: int, trim: int) -> Array:
    """Return the weight of every sample of a stretch, shape (N,), that rises over the first samples and falls over the last.

    What is before the first position is a guess, and with it the acceleration of a joint that moves there: unfaded, the
    low-pass carries 3 % of it to the first samples that are used, with this weight 1e-4 at the most.

    Parameters
    ----------
    samples : int
        N.
    trim : int
        Samples at either end of which none is used.
    """
    # Above zero throughout: no sample counts as at rest by it.
    rise = np.sin(0.5 * np.pi * np.arange(1, min(trim, samples) + 1) / (trim + 1)) ** 2
    result = np.ones(samples)
    result[: len(rise)] *= rise
    result[samples - len(rise) :] *= rise[::-1]
    return result


def _widening(periods: float, rate: float, band: float | None, longest: float = LONGEST_WIDENING) -> int:
    return 1 if band is None else max(1, int(rate * min(periods / (POSITION_BAND * band), longest)))


def velocity_noise(stretch: Stretch, motion: Motion, joint: int, band: float | None, least: float) -> float:
    """Return the standard deviation of the filtered velocity's noise, from what the filter took out, or the least given.

    White position noise of density s/rate integrates to ``s (2 pi)^2 f^3 / 3`` in velocity up to f.
    """
    cut = reach = motion.cuts[joint]
    if cut is None or reach is None:
        # Nothing was filtered; the noise is what a wide filter would take out. Within a wide band all of it is there.
        cut = NOISE_CUT_RATIO * stretch.rate
        reach = cut if band is None else 0.5 * stretch.rate
        smooth = stretch.filtered(joint, cut)[0]
    else:
        smooth = motion.q[joint]
    rest = np.abs(stretch.position[joint] - smooth)
    removed = max(0.5 * stretch.rate - cut, 0.05 * stretch.rate)
    # The median ignores the moments at which real motion is faster than the filter.
    gain = 2.0 * np.pi * float(np.sqrt(reach**3 / (3.0 * removed))) / NORMAL_MEDIAN
    small = 2 * np.count_nonzero(gain * rest <= least) > len(rest)
    return least if small else max(least, gain * median(rest))
