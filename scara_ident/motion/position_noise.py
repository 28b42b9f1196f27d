"""The noise of recorded positions, and recordings that have it twice.

Differentiated twice it stands in the regressor, and in the columns of some effects it is differentiated four times: what
depends on it is the more wrong the larger it is. How wrong is seen by adding as much again (Cook and Stefanski 1994,
"Simulation-extrapolation estimation in parametric measurement error models").
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from weakref import WeakKeyDictionary

import numpy as np

from scara_ident.arrays import NORMAL_MEDIAN, Array, median
from scara_ident.motion.low_pass import low_pass, removed_share
from scara_ident.motion.motion import Stretch
from scara_ident.motion.prepared import PreparedData, PreparedRecording, PreparedStretch
from scara_ident.motion.rest import NOISE_CUT_RATIO, REST_NOISE, stepping_speeds, velocity_noise
from scara_ident.threads import side_by_side

# An interval longer than so many usual ones has lost samples; a clock is uneven, and its stamps rounded, from these shares of the
# interval on, as `scara_ident.recording.audit` says so. Finer than this, s, stamps that count from 1970 hold rounding alone.
LOST_INTERVALS, JITTER_SHARE, COARSE_SHARE, FINEST_STAMP = 1.5, 0.03, 0.02, 1e-6
# Of what rounded stamps would make this share at least is measured, or samples were taken at whole steps of time.
BY_STAMPS = 0.25
# Drawn by seed: fits, candidates and what is left all look at the same.
_NOISIER: WeakKeyDictionary[PreparedData, dict[int, PreparedData]] = WeakKeyDictionary()
# Of every joint of a stretch the step in which its positions go, if any, and the standard deviation of its white noise.
NoiseSizes = tuple[tuple[float | None, float], ...]
# Where positions scatter by more than so many times what their steps round off, they have white noise beside these: a file
# may hold a noisy position to many digits, and an uneven clock to few.
BEYOND_STEPS = 2.0
_SIZES: WeakKeyDictionary[PreparedData, tuple[tuple[NoiseSizes, ...], ...]] = WeakKeyDictionary()
# Beyond this share of the rate there is hardly anything but noise: below it a joint that swings faster than any band may move.
TOP = 0.35
# A swing that the motion excites is small at times, while noise is always there: of so many samples each, with this share of them
# quieter, an rms is looked at. Fewer than so many of them tell no such share.
QUIET_SAMPLES = 32
QUIET_SHARE = 0.1
MIN_BLOCKS = 20
# Where steps fall anew is that of a position that has little left of them: with much left, the same ones would come
# again. Whether it is the motion to less than a step matters not.
STEPLESS = 0.02
# Steps about two zeros that lie so much of a step apart are uncorrelated: ``1 - 6 x (1 - x)`` is zero.
UNCORRELATED_SHIFT = 0.5 - np.sqrt(1.0 / 12.0)
# Torque and acceleration beyond any band that are so much alike are one swing of the arm; noise of either is no part of
# the other.
SWING_CORRELATION = 0.5
# A torque that swings acts on other joints as it is, times how much farther the masses that it swings lie from their axes than from
# its own: the reach of an arm over that of its wrist. One that is less than theirs by more does not shake them.
LEVER = 10.0
# A joint that travels by a smaller share of what it can, or of a turn, hardly moves: further is better before finer.
MIN_TRAVEL_SHARE = 0.1
# Time over which a joint's speed is taken, s, in which the steps of its encoder hardly count.
SPEED_OVER = 0.1


def coarse_positions(item: PreparedRecording, unit: Callable[[int], str]) -> str | None:
    """Name the joints whose encoders are too coarse for their bands: what counts as at rest is as fast as they move.

    Parameters
    ----------
    unit : callable
        Returns that of a joint's position.

    Returns
    -------
    str or None
        Which, by which step, and what to do; None where all are fine enough.
    """
    part = item.longest
    nyquist = 0.5 * part.rate
    apart = min(part.samples - 1, max(1, round(SPEED_OVER * part.rate)))
    found = []
    slow = stepping_speeds(part.stretch, part.cuts)
    for joint, (position, step) in enumerate(zip(part.stretch.position, part.stretch.steps, strict=True)):
        if step is None:
            continue
        cut = part.cuts[joint] or nyquist
        # White noise of a step's rounding, differentiated, up to the filter's frequency.
        noise = step / np.sqrt(12.0) * 2.0 * np.pi * np.sqrt(cut**3 / (3.0 * nyquist))
        speed = np.sqrt(np.mean((position[apart:] - position[:-apart]) ** 2)) * part.rate / apart
        if max(REST_NOISE * noise, slow[joint]) > speed > 0.0:
            name, way = item.recording.joints[joint], float(np.ptp(position))
            found.append((name, step, part.bands[joint], way, unit(joint)))
    said = [
        _too_coarse([each for each in found if (each[3] < MIN_TRAVEL_SHARE * 2.0 * np.pi) is little], little=little)
        for little in (True, False)
    ]
    return "; ".join(each for each in said if each) or None


def _too_coarse(found: Sequence[tuple[str, float, float | None, float, str]], *, little: bool) -> str:
    """Say what to do about joints with their steps, bands and ways, all of which move little or none."""
    if not found:
        return ""
    joints, (_, step, band, way, unit) = ", ".join(name for name, *_ in found), found[0]
    within = "without a low-pass" if band is None else f"in a band of {band:.3g} Hz"
    indistinct = f"{within} rest and motion cannot be distinguished"
    if little:
        return (
            f"positions of {joints} move by {way:.2g} {unit} in all, in steps of {step:.2g} {unit}, so little that "
            f"{indistinct}; move further and faster, or give a narrower band"
        )
    return (
        f"positions of {joints} go in steps of {step:.2g} {unit}, so coarse that {indistinct}; record with a finer encoder, "
        "faster motion, or give a narrower band"
    )


def unresolved_joints(data: PreparedData) -> dict[int, str]:
    """Return which joints swing so fast and far, most of the time recorded, that rest and motion cannot be told apart.

    What swings beyond half the rate, as under a controller that shakes, stands at other frequencies in what is recorded;
    the signs of speeds and the products of them that the columns hold then do not belong to the torque. Where one joint
    shakes with more torque than it moves with, all that it can shake are shaken: none of them is resolved.

    Returns
    -------
    dict of int to str
        The place of each joint, and why in words.
    """
    parts = data.stretches
    whole = sum(part.samples for part in parts)
    found = {}
    for joint, band in enumerate(data.bands):
        shaken = 0
        for part in parts:
            apart = min(part.samples - 1, max(1, round(SPEED_OVER * part.rate)))
            position = part.stretch.position[joint]
            speed = np.sqrt(np.mean((position[apart:] - position[:-apart]) ** 2)) * part.rate / apart
            swing = velocity_noise(part.stretch, part.motion, joint, band, 0.0)
            shaken += part.samples * bool(REST_NOISE * swing > speed > 0.0)
        if shaken > 0.5 * whole:
            found[joint] = (
                "its positions oscillate too fast for the sample rate, so rest and motion cannot be distinguished: "
                "find the cause of the vibration, or record faster or smoother motions"
            )
    return found | {
        joint: f"the arm vibrates: {shaking}, and with friction and sampling this looks like effects: find the cause "
        f"of the vibration, and record smoother motions"
        for joint, shaking in _shaken(data).items()
    }


def _shaken(data: PreparedData) -> dict[int, str]:
    """Say by which joint each is shaken: one whose torque swings more beyond any band than it changes within, and its position with it."""
    parts = [(part.stretch, part.stretch.torque) for part in data.stretches if part.stretch.torque is not None]
    if not parts:
        return {}
    names = data.recordings[0].recording.joints
    sides = [[_both_sides(torque[joint], part.rate) for part, torque in parts] for joint in range(len(names))]
    changes, swings = (np.array([sum(float(own[k] @ own[k]) for own in each) for each in sides]) for k in (0, 1))
    found: dict[int, str] = {}
    for joint in np.flatnonzero(swings > changes):
        with_it = [_both_sides(np.diff(part.position[joint], 2), part.rate)[1] for part, _ in parts]
        both = sum(float(a @ b[1:-1]) for a, (_, b) in zip(with_it, sides[joint], strict=True))
        if abs(both) <= SWING_CORRELATION * np.sqrt(swings[joint] * sum(float(own @ own) for own in with_it)):
            continue
        why = f"the torque of {names[joint]} oscillates more above {NOISE_CUT_RATIO * parts[0][0].rate:.3g} Hz than it changes below"
        for other in np.flatnonzero(changes < LEVER**2 * swings[joint]):
            found.setdefault(int(other), why)
    return found


def _both_sides(signal: Array, rate: float) -> tuple[Array, Array]:
    """Return how a signal, shape (N,), changes within the widest band, and what is beyond it."""
    within = low_pass(signal, rate, NOISE_CUT_RATIO * rate)
    return within - np.mean(within), signal - within


def noise_level(part: PreparedStretch, joint: int) -> float:
    """Return the standard deviation of a position's noise, taken as white, from what its filter took out."""
    stretch = part.stretch
    smooth, cut = _smooth(part, joint)
    # The median ignores the moments at which real motion is faster than the filter.
    scatter = median(np.abs(stretch.position[joint] - smooth)) / NORMAL_MEDIAN
    nyquist = 0.5 * stretch.rate
    return float(scatter / np.sqrt(max(nyquist - cut, 0.1 * nyquist) / nyquist))


def _smooth(part: PreparedStretch, joint: int, widest: float = NOISE_CUT_RATIO) -> tuple[Array, float]:
    """Return a filtered position, shape (N,), and the filter's frequency, at most this share of the rate."""
    cut, widest = part.cuts[joint], widest * part.stretch.rate
    if cut is not None and cut <= widest:
        return part.motion.q[joint], cut
    return part.stretch.filtered(joint, widest)[0], widest


def noise_sizes(data: PreparedData) -> tuple[tuple[NoiseSizes, ...], ...]:
    """Return the sizes of the noise of every stretch of every recording, measured once."""
    if data not in _SIZES:

        def of_recording(item: PreparedRecording) -> tuple[NoiseSizes, ...]:
            steps = item.longest.stretch.steps
            late = stamp_rounding(item.recording.time) / np.sqrt(12.0)
            return tuple(
                tuple(
                    (step, _beside_stamps(part, joint, _white(part, joint, step), late))
                    for joint, step in enumerate(steps)
                )
                for part in item.stretches
            )

        _SIZES[data] = tuple(side_by_side(of_recording, data.recordings))
    return _SIZES[data]


def stamp_rounding(time: Array) -> float:
    """Return to what the stamps of an uneven clock are rounded, s; 0 of an even one, and where it is too little to tell.

    Parameters
    ----------
    time : ndarray, shape (N,)
        s.
    """
    interval = np.diff(time)
    usual = median(interval)
    near = interval[interval < LOST_INTERVALS * usual]
    if not len(near) or float(np.std(near)) <= JITTER_SHARE * usual:
        return 0.0
    rounded = FINEST_STAMP * float(np.gcd.reduce(np.rint(interval / FINEST_STAMP).astype(np.int64)))
    return rounded if rounded > COARSE_SHARE * usual else 0.0


def _beside_stamps(part: PreparedStretch, joint: int, level: float, late: float) -> float:
    """Return the standard deviation of white noise where stamps lie off by so many seconds (rms), which moves positions by their way in it.

    What a spline through uneven samples makes of that is less at the high frequencies that it is measured at.
    """
    moving = part.motion.v[joint][part.used[joint]]
    made = late * float(np.sqrt(np.mean(moving**2))) if len(moving) else 0.0
    return made if level < made < level / BY_STAMPS else level


def _white(part: PreparedStretch, joint: int, step: float | None) -> float:
    """Return the standard deviation of what scatters beside the rounding of steps."""
    level = noise_level(part, joint)
    if step is None:
        # A position without steps may have been filtered, which leaves no noise at the highest frequencies. What is neither
        # there nor at all times is motion; noise of uneven stamps grows with speed, but is white.
        always = _level_at_quietest(part, joint)
        return (
            level if always >= level else min(level, max(always, _level_beyond(part, joint, TOP * part.stretch.rate)))
        )
    rounding = step / np.sqrt(12.0)
    if level > BEYOND_STEPS * rounding:
        # White noise is at the highest frequencies too, where an arm that swings beyond its band moves no more.
        level = min(level, _level_beyond(part, joint, TOP * part.stretch.rate))
    return float(np.sqrt(level**2 - rounding**2)) if level > BEYOND_STEPS * rounding else 0.0


def _level_beyond(part: PreparedStretch, joint: int, cut: float) -> float:
    """Return the standard deviation of white noise that leaves as much beyond a frequency, Hz, as a position has there."""
    position, rate = part.stretch.position[joint], part.stretch.rate
    scatter = median(np.abs(position - low_pass(position, rate, cut))) / NORMAL_MEDIAN
    return float(scatter / np.sqrt(removed_share(rate, cut)))


def _level_at_quietest(part: PreparedStretch, joint: int) -> float:
    """Return the standard deviation of noise, taken as white, that leaves what a moving joint has at its quietest beyond its filter.

    Infinite where it moves for too short a time to tell.
    """
    smooth, cut = _smooth(part, joint)
    count = len(smooth) // QUIET_SAMPLES
    blocks = (part.stretch.position[joint] - smooth)[: count * QUIET_SAMPLES].reshape(count, QUIET_SAMPLES)
    # An encoder whose steps were filtered away is silent at rest.
    moving = np.all(part.used[joint][: count * QUIET_SAMPLES].reshape(count, QUIET_SAMPLES), axis=1)
    if np.count_nonzero(moving) < MIN_BLOCKS:
        return float("inf")
    from scipy.special import chdtri

    left = removed_share(part.stretch.rate, cut)
    freedom = left * QUIET_SAMPLES
    usual = chdtri(freedom, 1.0 - QUIET_SHARE) / freedom
    square = np.quantile(np.mean(blocks[moving] ** 2, axis=1), QUIET_SHARE)
    return float(np.sqrt(square / (usual * left)))


def noisier(data: PreparedData, seed: int = 0) -> PreparedData:
    """Return recordings with the noise of their positions once more on top.

    Where an encoder has steps, those of the same size about another zero are added, so that what follows the motion in
    them does so again; where it has none, or scatters by more, white noise of the size that the filter takes out. Rows are
    of the same samples: how noise moves what is estimated from them is asked, not what fewer of them say.

    Parameters
    ----------
    seed : int, optional
        Of the draw; with the same seed the same data is drawn and prepared once.
    """
    drawn = _NOISIER.setdefault(data, {})
    if seed not in drawn:
        drawn[seed] = _drawn(data, seed)
    return drawn[seed]


def forget_noisier(data: PreparedData) -> None:
    """Forget what was drawn of recordings in bands that are left."""
    _NOISIER.pop(data, None)


def forget_stepless(data: PreparedData) -> None:
    """Forget the positions without steps that steps were drawn on."""
    for part in data.stretches:
        part.stretch.forget_filtered((STEPLESS * part.rate,))


def _drawn(data: PreparedData, seed: int) -> PreparedData:
    rng = np.random.default_rng(seed)
    recordings = []
    for item, each in zip(data.recordings, noise_sizes(data), strict=True):
        parts = tuple(
            replace(part, stretch=_noisier(part, sizes, rng), rests_as=part)
            for part, sizes in zip(item.stretches, each, strict=True)
        )
        recordings.append(PreparedRecording(item.recording, parts))
    return replace(data, recordings=tuple(recordings))


def _noisier(part: PreparedStretch, sizes: NoiseSizes, rng: np.random.Generator) -> Stretch:
    stretch = part.stretch
    position = stretch.position.copy()
    for joint, (step, level) in enumerate(sizes):
        if level > 0.0 or step is None:
            position[joint] += level * rng.standard_normal(position.shape[1])
        if step is not None:
            smooth = _smooth(part, joint, STEPLESS)[0] + step * rng.choice(
                (UNCORRELATED_SHIFT, 1.0 - UNCORRELATED_SHIFT)
            )
            position[joint] += step * np.round(smooth / step) - smooth
    return replace(stretch, position=position, _filtered={}, _thinned={})
