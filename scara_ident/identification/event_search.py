"""Where in time a residual stands out from what it is elsewhere: short, rare, and nothing that the motion repeats.

The residual of a robust fit is bounded at five standard deviations, so that a single sample says little, and averaged in
bins. What other recordings have at the same state of motion is taken off it, and a trend of its own run. Means over windows
of 0.15 to 2 s are then compared with their own scale (the median absolute value over all recordings, and over this one), in
which colour of the noise and what the model lacks everywhere are included. A stretch stands out where such a mean is beyond
what the largest of each second lets expect once in ten hours (Gumbel's law; Coles, *An Introduction to Statistical Modeling of
Extreme Values*, 2001). Its ends are where the likelihood that the variance is larger between them is largest.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.motion.prepared import PreparedStretch, standstill

# Length of a bin and of the windows, s.
BIN = 0.04
WINDOWS = (0.16, 0.32, 0.6, 1.2, 2.0)
# Standard deviations at which a sample's residual is bounded, and the normal's over its median absolute value.
BOUND = 5.0
# The same where it is asked what other recordings have at the same state.
LOOSE = 40.0
# Nothing is said of a joint slower than this share of its peak speed, where friction is known least.
SLOW = 0.05
NORMAL = 1.4826
# Share of a window that has to be used, and rows of a scale, or nothing is said of it.
FILLED = 0.6
LEAST_WINDOWS = 20
# At most one false event in so many seconds, and the least mean that counts, in standard deviations of its windows.
FALSE_EVERY = 36_000.0
LEAST_SCORE = 6.5
# What a model lacks makes the largest larger than that law; found by benchmarks/events.py.
HEAVIER = 1.4
# Least rms of an event in standard deviations of a bin, and in that of the residual before anything was taken off it.
LEAST_SIZE, LEAST_BEFORE = 2.0, 0.5
# What lasts longer than this, s, and than this share of its recording is a change of the arm. What does not stand out surely is
# seen for so long, s, before and after it within the other: how an arm starts and stops is no event.
LONGEST, LONGEST_SHARE = 3.0, 0.15
SEEN, BESIDE = 0.3, 1.0
# Where speed, acceleration or torque are above this share of all, only what stands out by so much is an event.
USUAL, SURE = 0.97, 2.2
# Events are rare: a residual that stands out in more of the time than this is the model's doing.
RARE = 0.2
# A joint helps to find the ends of an event if it stands out by this share of what would make it one.
AT_ENDS = 0.45
# Events looked for in a stretch, and how far one may reach to either side of what stands out most, s.
MOST_IN_STRETCH = 12
REACH = 5.0
# Its ends are looked for again between so long within and so long beyond them, s.
EDGE = (0.3, 0.6)
EVENT_SECONDS = 5.0
# Functions of the state taken off at the most, the share of the squared residual that one removes at the least, what harm
# counts against gain, and standard deviations beyond which a bin's weight falls.
MOST_FEATURES, LEAST_GAIN, HARM, INFLUENCE = 6, 0.02, 0.5, 10.0
# Of so many bins one is fitted to.
THIN = 2


@dataclass(frozen=True, eq=False)
class Binned:
    """A stretch's residual in bins of time.

    Attributes
    ----------
    recording : int
        Place of its recording.
    part : PreparedStretch
    size : int
        Samples in a bin.
    raw : ndarray, shape (n, M * size)
        Residual at every sample, nothing filtered, N m or N.
    used : ndarray of bool, shape (n, M * size)
        Samples that count.
    noise : ndarray, shape (n,)
        Standard deviation that samples are bounded by.
    state : tuple of ndarray, shape (n, M)
        Position, velocity, acceleration and predicted torque in the middle of each bin.
    taken : ndarray, shape (n, M)
        What is taken off the residual before it is bounded.
    """

    recording: int
    part: PreparedStretch
    size: int
    raw: Array
    used: NDArray[np.bool_]
    noise: Array
    state: tuple[Array, Array, Array, Array]
    taken: Array

    @cached_property
    def known(self) -> Array:
        """Share of each bin that is used, shape (n, M)."""
        return np.asarray(self.used.reshape(*self.taken.shape, self.size).mean(axis=2))

    @cached_property
    def left(self) -> Array:
        """Mean residual over what is used of each bin, bounded sample by sample, shape (n, M)."""
        return self.bounded(BOUND)

    def bounded(self, bound: float) -> Array:
        """Return the mean residual of bins with samples bounded at so many standard deviations, shape (n, M)."""
        shape = (*self.taken.shape, self.size)
        most = (bound * self.noise)[:, None, None]
        inside = np.clip(self.raw.reshape(shape) - self.taken[:, :, None], -most, most) * self.used.reshape(shape)
        return np.asarray(inside.mean(axis=2) / np.maximum(self.known, 1.0 / self.size))

    def without(self, more: Array) -> Binned:
        """Return it with more taken off the residual, shape (n, M)."""
        return replace(self, taken=self.taken + more)

    @property
    def width(self) -> float:
        """Length of a bin, s."""
        return self.size / self.part.rate

    @cached_property
    def sums(self) -> tuple[Array, Array]:
        """Sums of residual and use up to each bin, shape (n, M + 1)."""
        zero = np.zeros((len(self.left), 1))
        each = (self.left * self.known, self.known)
        return tuple(np.concatenate([zero, np.cumsum(item, axis=1)], axis=1) for item in each)  # type: ignore[return-value]

    def means(self, length: int) -> Array:
        """Return the mean over windows of so many bins, shape (n, M - length + 1); NaN where too little is used."""
        total, used = (item[:, length:] - item[:, :-length] for item in self.sums)
        return np.where(used >= FILLED * length, total / np.maximum(used, FILLED), np.nan)


@dataclass(frozen=True, eq=False)
class Segment:
    """A stretch of time that stands out.

    Attributes
    ----------
    binned : Binned
    start, stop : int
        Bins, the second not in it.
    score : ndarray, shape (n,)
        By how much each joint stands out, 1 where that alone would be an event.
    """

    binned: Binned
    start: int
    stop: int
    score: Array


def bounded_noise(parts: Sequence[PreparedStretch], left: Sequence[Array], owner: Sequence[int]) -> dict[int, Array]:
    """Return for each recording the standard deviation of each joint's residual by its median, the larger of its and all's."""
    used = [part.used for part in parts]

    def scale(chosen: Sequence[int]) -> Array:
        found = []
        for j in range(len(left[0])):
            values = np.concatenate([left[k][j][used[k][j]][:: max(1, len(left[k][j]) // 5000)] for k in chosen])
            found.append(NORMAL * float(np.median(np.abs(values))) if len(values) else 0.0)
        return np.array(found)

    everything = scale(range(len(parts)))
    return {
        k: np.maximum(everything, scale([i for i, own in enumerate(owner) if own == k])) for k in dict.fromkeys(owner)
    }


def binned(recording: int, part: PreparedStretch, left: Array, noise: Array) -> Binned:
    """Return the residual of a stretch, shape (n, N), in bins; what an event left out counts again."""
    size = max(1, round(BIN * part.rate))
    count = part.samples // size
    used = part.used
    if np.any(part.left_out):
        used = ~standstill(part.stretch, part.motion, part.bands)
        used[:, : part.trim] = used[:, max(part.trim, part.samples - part.trim) :] = False
    motion, middle = part.motion, slice(size // 2, count * size, size)
    speed = np.abs(motion.v)
    used = (used & (speed > SLOW * np.max(speed, axis=1, keepdims=True)))[:, : count * size]
    signals = (motion.q, motion.v, motion.a, part.torque - left)
    q, v, a, load = (row[:, middle] for row in signals)
    return Binned(recording, part, size, left[:, : count * size], used, noise, (q, v, a, load), np.zeros_like(q))


def standing_out(stretches: Sequence[Binned]) -> list[Segment]:
    """Return the stretches of time that stand out, in the order in which they come.

    Parameters
    ----------
    stretches : sequence of Binned
        Of all recordings.
    """
    stretches = [item for item in stretches if item.taken.shape[1] > 1]
    if not stretches:
        return []
    plain = stretches
    stretches = without_trends(without_states(stretches))
    scores = _scores(stretches)
    found = []
    for item, original, score in zip(stretches, plain, scores, strict=True):
        sigma = _bin_noise(stretches, item)
        for segment in _segments(item, score, sigma):
            size, before = _sizes(item, original, segment)
            large = (size > LEAST_SIZE * sigma) & (before > LEAST_BEFORE * size)
            shown = large & (segment.score >= 1.0)
            if np.any(shown) and _local(segment) and not _novel(segment, stretches, shown):
                found.append(segment)
    total = sum(item.left.shape[1] * item.width for item in stretches)
    lasting = sum((segment.stop - segment.start) * segment.binned.width for segment in found)
    return found if lasting <= RARE * total else []


def _sizes(item: Binned, original: Binned, segment: Segment) -> tuple[Array, Array]:
    """Return the rms of each joint in a segment, and as much of it as was there before anything was taken off, (n,) each."""
    inside = slice(segment.start, segment.stop)
    known, left = item.known[:, inside], item.left[:, inside]
    weight = np.maximum(np.sum(known, axis=1), 1e-9)
    size = np.sqrt(np.sum(known * left**2, axis=1) / weight)
    return size, np.sum(known * left * original.left[:, inside], axis=1) / weight / np.maximum(size, 1e-300)


def _local(segment: Segment) -> bool:
    """Whether it is short, and a joint that shows it is seen before and after it."""
    item = segment.binned
    length = (segment.stop - segment.start) * item.width
    beside, seen = round(BESIDE / item.width), SEEN / item.width
    shown = item.known[segment.score >= 1.0]
    before = np.sum(shown[:, max(0, segment.start - beside) : segment.start], axis=1)
    after = np.sum(shown[:, segment.stop : segment.stop + beside], axis=1)
    whole = item.left.shape[1] * item.width
    seen_beside = bool(np.any((before >= seen) & (after >= seen))) or float(np.max(segment.score)) >= SURE
    return length <= max(LONGEST, LONGEST_SHARE * whole) and seen_beside


def _novel(segment: Segment, stretches: Sequence[Binned], shown: NDArray[np.bool_]) -> bool:
    """Whether the arm is then faster, or loaded more, than nearly ever: the model is not known there."""
    item, inside = segment.binned, slice(segment.start, segment.stop)
    for j in np.flatnonzero(shown & (segment.score < SURE)):
        for k in (1, 2, 3):
            usual = np.concatenate([np.abs(other.state[k][j]) for other in stretches])
            if np.median(np.abs(item.state[k][j, inside])) > np.quantile(usual, USUAL):
                shown = shown & (np.arange(len(shown)) != j)
    return not np.any(shown)


def _scores(stretches: Sequence[Binned]) -> list[list[tuple[int, Array]]]:
    """Return for each stretch the means over windows of every length, as shares of what would be an event, (n, windows)."""
    n = len(stretches[0].left)
    scaled: list[list[tuple[int, Array]]] = [[] for _ in stretches]
    for window in WINDOWS:
        lengths = [max(1, round(window / item.width)) for item in stretches]
        means = [
            np.abs(item.means(length)) if item.left.shape[1] > length else np.full((n, 0), np.nan)
            for item, length in zip(stretches, lengths, strict=True)
        ]
        whole = _median(means)
        for k, (item, mean) in enumerate(zip(stretches, means, strict=True)):
            own = [other for other, part in zip(means, stretches, strict=True) if part.recording == item.recording]
            scale = np.maximum(whole, _median(own))
            with np.errstate(divide="ignore", invalid="ignore"):
                scaled[k].append((lengths[k], np.where(scale[:, None] > 0.0, mean / scale[:, None], np.nan)))
    tops = [_by_second(item, scores) for item, scores in zip(stretches, scaled, strict=True)]
    limits = np.array([_limit(np.concatenate([top[j] for top in tops]), n) for j in range(n)])
    return [[(length, score / limits[:, None]) for length, score in scores] for scores in scaled]


def _median(means: Sequence[Array]) -> Array:
    together = np.concatenate(means, axis=1)
    found = np.zeros(len(together))
    for j, row in enumerate(together):
        known = row[np.isfinite(row)]
        found[j] = NORMAL * float(np.median(known)) if len(known) >= LEAST_WINDOWS else np.nan
    return np.nan_to_num(found, nan=0.0)


def _by_second(item: Binned, scores: Sequence[tuple[int, Array]]) -> Array:
    """Return the largest score of each second, of any window, shape (n, seconds); NaN where none is known."""
    n, count = item.left.shape
    best = np.full((n, count), -1.0)
    for length, score in scores:
        if score.shape[1]:
            inside = best[:, length // 2 : length // 2 + score.shape[1]]
            np.fmax(inside, score, out=inside)
    second = max(1, round(1.0 / item.width))
    whole = count // second
    top = best[:, : whole * second].reshape(n, whole, second).max(axis=2)
    return np.where(top > 0.0, top, np.nan)


def _limit(tops: Array, joints: int) -> float:
    """Return the score that the largest of a second exceeds on any joint once in `FALSE_EVERY`, by Gumbel's law."""
    tops = tops[np.isfinite(tops)]
    if len(tops) < 5:
        return np.inf
    # One event and the windows beside it are in so many seconds; of few seconds the upper quantile is lower.
    share = float(np.clip(1.0 - EVENT_SECONDS / len(tops), 0.6, 0.8))
    middle, upper = np.quantile(tops, (0.5, share))
    spread = (upper - middle) / (np.log(-np.log(0.5)) - np.log(-np.log(share)))
    expected = -np.log(-np.log(0.5)) * -spread + middle + spread * np.log(FALSE_EVERY * joints)
    return max(LEAST_SCORE, HEAVIER * float(expected))


def _bin_noise(stretches: Sequence[Binned], item: Binned) -> Array:
    """Return the standard deviation of single bins of each joint by their median, the larger of all's and its recording's."""
    groups = (stretches, [other for other in stretches if other.recording == item.recording])
    found = []
    for group in groups:
        each = [np.where(other.known > FILLED, np.abs(other.left), np.nan) for other in group]
        found.append(_median(each))
    return np.maximum(*found)


def _segments(item: Binned, scores: Sequence[tuple[int, Array]], noise: Array) -> Iterator[Segment]:
    """Give what stands out most, then what does beside it, and so on."""
    n, count = item.left.shape
    free = np.ones(count, dtype=bool)
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.where((item.known > FILLED) & (noise[:, None] > 0.0), item.left / noise[:, None], 0.0)
    for _ in range(MOST_IN_STRETCH):
        best, place, long = 1.0, -1, 0
        for length, score in scores:
            if not score.shape[1]:
                continue
            taken = np.concatenate([[0], np.cumsum(~free)])
            open_ = taken[length:] == taken[:-length]
            top = np.where(open_, np.nanmax(np.nan_to_num(score, nan=0.0), axis=0), 0.0)
            k = int(np.argmax(top))
            if top[k] > best:
                best, place, long = float(top[k]), k, length
        if place < 0:
            return
        window = slice(place, place + long)
        share = np.zeros(n)
        for length, score in scores:
            near = score[:, max(0, place - length // 2) : place + max(1, long - length // 2)]
            if near.shape[1]:
                share = np.fmax(share, np.nanmax(np.nan_to_num(near, nan=0.0), axis=1))
        own = share >= min(AT_ENDS, best)
        power = np.maximum(np.mean(relative[own][:, window] ** 2, axis=1), 2.0)
        # Of log variance: what is between the ends has the power of the window, what is outside has 1.
        value = np.minimum(relative[own] ** 2, 4.0 * power[:, None])
        likelihood = np.sum(0.5 * (value * (1.0 - 1.0 / power[:, None]) - np.log(power[:, None])), axis=0)
        likelihood[~free] = -np.inf
        middle, reach = place + long // 2, int(REACH / item.width)
        before = np.cumsum(likelihood[max(0, middle - reach) : middle + 1][::-1])
        after = np.cumsum(likelihood[middle : middle + reach])
        start = middle - int(np.argmax(before))
        stop = middle + int(np.argmax(after)) + 1
        near, far = (round(seconds / item.width) for seconds in EDGE)
        start = max(0, stop - 1) - _reach(np.where(free, relative, 0.0)[:, :stop][:, ::-1], stop - start, near, far) + 1
        stop = start + _reach(np.where(free, relative, 0.0)[:, start:], stop - start, near, far)
        pad = max(1, round(0.1 / item.width))
        free[max(0, min(start, place) - pad) : max(stop, place + long) + pad] = False
        yield Segment(item, start, stop, share)


def _reach(relative: Array, length: int, near: int, far: int) -> int:
    """Return how many bins from the first on a shift of the mean lasts, which is known to last about so many.

    By likelihood, with the mean of each joint as it is shortly before the end; a joint that shows nothing counts for nothing.
    """
    mean = np.mean(relative[:, max(0, length - near) : length], axis=1, keepdims=True)
    first = max(0, length - near)
    likelihood = np.cumsum(np.sum(2.0 * relative * mean - mean**2, axis=0)[first : length + far])
    return first + int(np.argmax(likelihood)) + 1 if len(likelihood) else length


def without_trends(stretches: Sequence[Binned]) -> list[Binned]:
    """Take off what its own run has all along: an offset, a share of the load and of friction, and their drift."""
    trends = [np.zeros_like(item.taken) for item in stretches]
    for k in dict.fromkeys(item.recording for item in stretches):
        own = [i for i, item in enumerate(stretches) if item.recording == k]
        seconds = sum(stretches[i].left.shape[1] * stretches[i].width for i in own)
        for j in range(len(stretches[0].left)):
            speed = max(float(np.max(np.abs(stretches[i].state[1][j]))) for i in own) or 1.0
            rows, left, known = [], [], []
            for i in own:
                q, v, a, load = (state[j] for state in stretches[i].state)
                time = np.arange(len(v)) * stretches[i].width / max(seconds, 1.0)
                sign = np.tanh(10.0 * v / speed)
                columns = [np.ones_like(v), sign, load, time, time * sign]
                rows.append(np.array(columns[: 5 if seconds >= 10.0 else 1]))
                left.append(stretches[i].left[j])
                known.append(stretches[i].known[j])
            fitted = _robust_trend(rows, left, known)
            for i, trend in zip(own, fitted, strict=True):
                trends[i][j] = trend
    return [item.without(trend) for item, trend in zip(stretches, trends, strict=True)]


def _robust_trend(rows: Sequence[Array], left: Sequence[Array], known: Sequence[Array]) -> list[Array]:
    """Return what columns (k, M) explain of a residual by Tukey's weights of bins; nothing where there is too little."""
    together, target = np.concatenate(rows, axis=1), np.concatenate(left)
    use = (np.concatenate(known) > FILLED).astype(float)
    whole, together, target, use = together, together[:, ::THIN], target[::THIN], use[::THIN]
    size = np.sqrt(np.mean(together**2, axis=1, keepdims=True))
    size = np.where(size > 0.0, size, 1.0)
    together = together / size
    value = np.zeros(len(together))
    if np.sum(use) < LEAST_WINDOWS * len(together) / THIN:
        return [np.zeros_like(item) for item in left]
    for _ in range(6):
        off = target - value @ together
        scale = NORMAL * float(np.median(np.abs(off[use > 0.0])))
        if scale == 0.0:
            break
        weight = use * np.maximum(0.0, 1.0 - (off / (4.0 * scale)) ** 2) ** 2
        weighted = together * weight
        normal = weighted @ together.T
        normal += 1e-6 * np.trace(normal) / len(normal) * np.eye(len(normal)) + 1e-300
        value = np.linalg.solve(normal, weighted @ target)
    return np.split((value / size[:, 0]) @ whole, np.cumsum([len(item) for item in left])[:-1])


def without_states(stretches: Sequence[Binned]) -> list[Binned]:
    """Take off what other recordings, or other parts of the only one, have at the same state of motion.

    Only where that makes a recording's residual smaller; what happens once is in no other recording, and stays.
    """
    n = len(stretches[0].left)
    groups = _groups(stretches)
    count = 1 + max(int(group.max(initial=0)) for group in groups)
    if count < 2:
        return list(stretches)
    together = np.concatenate(groups)
    known = np.concatenate([item.known for item in stretches], axis=1) > FILLED
    left = np.concatenate([item.bounded(LOOSE) for item in stretches], axis=1)
    state = [np.concatenate([item.state[k] for item in stretches], axis=1) for k in range(4)]
    taken = np.zeros_like(left)
    for j in range(n):
        columns = _features(state, j)
        if not np.any(known[j]):
            continue
        taken[j] = _of_others(columns, left[j], known[j], together, count)
    parts = np.split(taken, np.cumsum([item.taken.shape[1] for item in stretches])[:-1], axis=1)
    return [item.without(part) for item, part in zip(stretches, parts, strict=True)]


def _groups(stretches: Sequence[Binned]) -> list[NDArray[np.intp]]:
    """Return for each bin the group that is explained by the others: its recording, or a quarter of the only one."""
    owners = list(dict.fromkeys(item.recording for item in stretches))
    if len(owners) > 1:
        return [np.full(item.left.shape[1], owners.index(item.recording)) for item in stretches]
    total = sum(item.left.shape[1] for item in stretches)
    places = np.minimum(np.arange(total) * 4 // max(1, total), 3)
    return np.split(places, np.cumsum([item.left.shape[1] for item in stretches])[:-1])


def _of_others(columns: Array, left: Array, known: NDArray[np.bool_], group: NDArray[np.intp], count: int) -> Array:
    """Return what functions of the state, one after the other, explain of each group by what they do in all others."""
    taken = np.zeros_like(left)
    for _ in range(MOST_FEATURES):
        off = left - taken
        scale = NORMAL * float(np.median(np.abs(off[known])))
        use = known * np.minimum(1.0, INFLUENCE * scale / np.maximum(np.abs(off), 1e-300))
        weighted = columns * use
        scores, squares = (np.zeros((count, len(columns))) for _ in range(2))
        for k in range(count):
            own = group == k
            scores[k], squares[k] = weighted[:, own] @ off[own], np.sum(weighted[:, own] * columns[:, own], axis=1)
        others = np.sum(squares, axis=0) - squares
        value = (np.sum(scores, axis=0) - scores) / np.where(others > 0.0, others, np.inf)
        gains = 2.0 * value * scores - value**2 * squares
        # Where it does harm to one recording it is not that recording's doing.
        gains[gains < 0.0] *= HARM
        best = int(np.argmax(np.sum(gains, axis=0)))
        if np.sum(gains[:, best]) < LEAST_GAIN * np.sum(use * off**2):
            break
        helps = np.where(gains[:, best] > 0.0, value[:, best], 0.0)
        taken += helps[group] * columns[best]
    return taken


def _features(state: Sequence[Array], joint: int) -> Array:
    """Return functions of the state that a joint's residual may depend on, of unit size, shape (k, M)."""
    q, v, a, load = state
    speed = np.maximum(np.max(np.abs(v), axis=1, keepdims=True), 1e-9)
    turn, own = np.tanh(10.0 * v / speed), v[joint] / speed[joint]
    sign, angle, torque = turn[joint], q[joint], load[joint]
    columns = [np.tanh(50.0 * own), np.tanh(2.0 * own), own, own**3, own * np.abs(own)]
    columns += [np.sin(2.0 * angle), np.cos(2.0 * angle), sign * np.sin(angle), sign * np.cos(angle)]
    columns += [sign * np.abs(torque), torque, torque**3, sign * np.minimum(sign * torque, 0.0)]
    result = np.array([*columns, *np.sin(q), *np.cos(q), *turn, *v, *a])
    size = np.sqrt(np.mean(result**2, axis=1, keepdims=True))
    return np.asarray(result / np.where(size > 0.0, size, 1.0))
