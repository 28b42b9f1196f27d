"""Search for events: where a residual stands out in time, briefly, rarely, and not with the motion.

Of the residual of a robust fit in bins what the motion makes is taken off (see `event_background`). Means over windows of 0.15
to 2 s are compared with their own scale (the median absolute value over all recordings, and over this one), in
which colour of the noise and what the model lacks everywhere are included. A stretch stands out where such a mean is beyond
what the largest of each second lets expect once in a hundred hours, by all laws that its square may have (see `estimation.tail`):
the mean of many samples is nearly normal, and the upper tail of its square exponential. Where an event begins and ends is
looked for last (see `event_ends`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array, median
from scara_ident.estimation.tail import HOUR, Tail, tail_of
from scara_ident.identification.binned_residual import BOUND, FILLED, NORMAL, STANDSTILL_SHARE, Binned
from scara_ident.identification.event_ends import GAP, Ends, event_ends

# Lengths of the windows, s.
WINDOWS = (0.16, 0.32, 0.6, 1.2, 2.0)
# Windows that a scale is taken from at the least, and seconds that the largest are.
MIN_WINDOWS, MIN_SECONDS = 20, 5
# Noise makes at most one false event in so many seconds; of what a model lacks there are more, and one in 10 h is too many.
FALSE_EVERY = 360_000.0
# The law is of the largest of so many seconds, or of that share of all if that is more, and of no more than half of them.
TOPS, TOPS_SHARE = 50, 0.1
# One event and the windows beside it are in so many seconds, all events in that share of all at the most. For each second beyond
# a law that looks away from so many, some more may be of events; and for each of those the law is of some that are not.
EVENT_SECONDS, EVENTS_SHARE, BESIDE_EVENTS, TOPS_PER_EVENT = 5, 0.15, 1.5, 3
# Standard deviation of the tail's shape before anything is seen: what a model lacks makes it heavier than exponential.
SHAPE_STD = 0.1
# Least rms of an event in standard deviations of a bin, and the share of it that least squares leave too.
MIN_SIZE, MIN_EVENT_SHARE = 2.0, 0.5
# What lasts longer than this, s, and than this share of its recording is a change of the arm. What does not stand out surely is
# seen for so long, s, before and after it within the other, and so is what is nearer to the ends of a recording than that: how
# an arm starts and stops is no event.
MAX_SECONDS, MAX_SHARE = 3.0, 0.15
SEEN_SECONDS, END_SECONDS = 0.3, 1.0
# Where speed, acceleration or torque are above this share of all, or all three farther from the next so many of other times than
# they are in that share of all, only what stands out by so much is an event. At the most so many bins are compared with.
USUAL_SHARE, USUAL_JOINT_SHARE, UNUSUAL_STDS, NEIGHBOURS, MAX_COMPARED = 0.97, 0.95, 3.3, 5, 2000
# Events are rare: a residual that stands out in more of the time than this is the model's doing.
RARE = 0.2
# A joint helps to find the ends of an event if it stands out by this share of what would make it one.
AT_ENDS = 0.45
# Events looked for in a stretch.
MAX_EVENTS_PER_STRETCH = 12


Shape = Callable[[Binned, int, int], Array | None]


@dataclass(frozen=True, eq=False)
class Segment:
    """A stretch of time that stands out.

    Attributes
    ----------
    score : ndarray, shape (n,)
        By how much each joint stands out, 1 where that alone would be an event.
    """

    binned: Binned
    ends: Ends
    score: Array

    @property
    def start(self) -> int:
        """First bin."""
        return self.ends.start

    @property
    def stop(self) -> int:
        """First bin after it."""
        return self.ends.stop


def standing_out(
    stretches: Sequence[Binned],
    earlier: Callable[[], Sequence[Sequence[Binned]]],
    shape: Shape = lambda item, start, stop: None,
) -> list[Segment]:
    """Return the stretches of time that stand out, in the order in which they come.

    Parameters
    ----------
    stretches : sequence of Binned
        Of all recordings, of parameters that no event has steered, less their background.
    earlier : callable
        Returns residuals of the same in which an event has to be seen too: of least squares, because what that explains is a
        state of motion that the robust fit took for an outlier; before trends were taken off, because one that is estimated from the
        rest of a run may be wrong where the run was once. Asked only where something stands out.
    shape : callable, optional
        Returns what an event from a bin to before another would leave in every bin, N m or N, shape (n, M); None where nobody
        can say. It helps to find the ends.
    """
    if not stretches:
        return []
    scores = _scores(stretches)
    shown_by = [k for k, score in enumerate(scores) if any(np.any(part > 1.0) for _, part in score)]
    if not shown_by:
        return []
    others, everywhere = earlier(), _bin_noise(stretches)
    slow = _median([np.where(_slow(item), np.abs(item.anyhow), np.nan) for item in stretches])
    found = []
    for k in shown_by:
        item = stretches[k]
        own = _bin_noise([other for other in stretches if other.recording == item.recording])
        sigma = np.maximum(everywhere, own)
        novel, usual = list[Segment](), list[Segment]()
        for segment in _segments(item, scores[k], sigma, slow, shape):
            size, before = _sizes(item, [other[k] for other in others], segment)
            large = (size > MIN_SIZE * sigma) & (before > MIN_EVENT_SHARE * size)
            shown = large & (segment.score >= 1.0)
            if np.any(shown) and _local(segment):
                (novel if _novel(segment, stretches, shown) else usual).append(segment)
        found += [segment for segment in usual if not _part_of(segment, novel)]
    total = sum(item.left.shape[1] * item.width for item in stretches)
    lasting = sum((segment.stop - segment.start) * segment.binned.width for segment in found)
    return found if lasting <= RARE * total else []


def _sizes(item: Binned, earlier: Sequence[Binned], segment: Segment) -> tuple[Array, Array]:
    """Return the rms of each joint in a segment, and the least of it that is there in each of some residuals, (n,) each."""
    inside = slice(segment.start, segment.stop)
    known, left = item.known[:, inside], item.left[:, inside]
    weight = np.maximum(np.sum(known, axis=1), 1e-9)
    size = np.sqrt(np.sum(known * left**2, axis=1) / weight)
    seen = [np.sum(known * left * other.left[:, inside], axis=1) for other in earlier]
    return size, np.min(seen, axis=0) / weight / np.maximum(size, 1e-300)


def _local(segment: Segment) -> bool:
    """Whether it is short, and a joint that shows it is seen before and after it."""
    item = segment.binned
    beside, seen = round(END_SECONDS / item.width), SEEN_SECONDS / item.width
    # Rests do not count.
    moves = np.logical_not(np.isfinite(item.still[0]))
    shown = np.maximum(item.known, _slow(item))[segment.score >= 1.0]
    before = np.sum(shown[:, : segment.start][:, moves[: segment.start]][:, -beside:], axis=1)
    after = np.sum(shown[:, segment.stop :][:, moves[segment.stop :]][:, :beside], axis=1)
    inside = beside <= segment.start and segment.stop + beside <= item.left.shape[1]
    sure = inside and float(np.max(segment.score)) >= UNUSUAL_STDS
    seen_beside = sure or bool(np.any((before >= seen) & (after >= seen)))
    return not _lasts(item, segment.ends) and seen_beside


def _lasts(item: Binned, ends: Ends) -> bool:
    """Whether it lasts too long for an event."""
    whole = item.left.shape[1] * item.width
    return bool((ends.stop - ends.start) * item.width > max(MAX_SECONDS, MAX_SHARE * whole))


def _novel(segment: Segment, stretches: Sequence[Binned], shown: NDArray[np.bool_]) -> bool:
    """Whether most of it is in states that the arm is hardly ever in: the model is not known there."""
    item, inside = segment.binned, slice(segment.start, segment.stop)
    power = item.known[:, inside] * item.left[:, inside] ** 2

    def usual(j: int) -> bool:
        most = [
            np.quantile(np.concatenate([np.abs(other.state[k][j]) for other in stretches]), USUAL_SHARE)
            for k in (1, 2, 3)
        ]
        beyond = [np.abs(item.state[k][j, inside]) > value for k, value in zip((1, 2, 3), most, strict=True)]
        own, often = _alone(segment, stretches, j)
        beyond.append(own > np.quantile(often, USUAL_JOINT_SHARE, method="higher"))
        return all(np.sum(power[j, there]) <= 0.5 * np.sum(power[j]) for there in beyond)

    return not any(segment.score[j] >= UNUSUAL_STDS or usual(int(j)) for j in np.flatnonzero(shown))


def _part_of(segment: Segment, novel: Sequence[Segment]) -> bool:
    """Whether it is next to what is in states hardly ever seen: filters carry that beyond them. What is large stands by itself."""
    near = GAP / segment.binned.width
    gaps = (max(segment.start, item.start) - min(segment.stop, item.stop) for item in novel)
    return bool(np.max(segment.score) < UNUSUAL_STDS) and any(gap <= near for gap in gaps)


def _alone(segment: Segment, stretches: Sequence[Binned], joint: int) -> tuple[Array, Array]:
    """Return how far a joint's states are from those next to them at other times: in each bin of a segment, and in all."""
    thin = -(-sum(item.left.shape[1] for item in stretches) // MAX_COMPARED)
    used = [np.flatnonzero(item.known[joint] > FILLED)[::thin] for item in stretches]
    place = [item is segment.binned for item in stretches].index(True)

    def states(k: int, bins: NDArray[np.intp]) -> Array:
        # Stretch and time tell what is another time.
        time = bins * stretches[k].width / MAX_SECONDS
        v, a, load = (row[joint, bins] for row in stretches[k].state[1:])
        # Friction turns with the speed: next to a slow motion is none the other way.
        return np.array([np.full(len(bins), k), time, v, np.sign(v), a, load])

    among = np.concatenate([states(k, bins) for k, bins in enumerate(used)], axis=1)
    scale = np.maximum(np.std(among[2:], axis=1), 1e-300)

    def distance(own: Array) -> Array:
        apart = np.zeros((own.shape[1], among.shape[1]))
        for row, other, size in zip(own[2:], among[2:], scale, strict=True):
            apart += ((row[:, None] - other) / size) ** 2
        apart[(own[0][:, None] == among[0]) & (np.abs(own[1][:, None] - among[1]) < 1.0)] = np.inf
        least = min(NEIGHBOURS, among.shape[1]) - 1
        return np.asarray(np.partition(apart, least, axis=1)[:, least])

    return distance(states(place, np.arange(segment.start, segment.stop))), distance(among)


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
        found[j] = NORMAL * median(known) if len(known) >= MIN_WINDOWS else np.nan
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
    """Return the score that the largest of a second exceeds on any joint once in `FALSE_EVERY`."""
    square = tops[np.isfinite(tops)] ** 2
    if len(square) < MIN_SECONDS:
        return np.inf
    most, rate = round(EVENTS_SHARE * len(square)), HOUR / (FALSE_EVERY * joints)
    surely = _tail(square, most).level(rate)
    events = min(most, round(BESIDE_EVENTS * np.sum(square > surely)))
    return float(np.sqrt(_tail(square, events).level(rate)))


def _tail(square: Array, events: int) -> Tail:
    """Return the law of the squares of the largest of each second, of which so many of the largest may be of events."""
    events = max(EVENT_SECONDS, events)
    count = min(max(TOPS, TOPS_SHARE * len(square), TOPS_PER_EVENT * events), len(square) / 2)
    start = float(np.quantile(square, 1.0 - count / len(square)))
    return tail_of(square, start, len(square), censored=min(events, int(count / 2)), prior=SHAPE_STD)


def _bin_noise(stretches: Sequence[Binned]) -> Array:
    """Return the standard deviation of single bins of each joint by their median, shape (n,)."""
    return _median([np.where(item.known > FILLED, np.abs(item.left), np.nan) for item in stretches])


def _slow(item: Binned) -> NDArray[np.bool_]:
    """Return where a joint turns slowly, but not so slowly that its friction may be of either sign, shape (n, M)."""
    speed = np.abs(item.state[1])
    turns = speed > STANDSTILL_SHARE * np.max(speed, axis=1, keepdims=True)
    return np.asarray(turns & ~(item.known > FILLED))


def _segments(
    item: Binned, scores: Sequence[tuple[int, Array]], noise: Array, slow: Array, shape: Shape
) -> Iterator[Segment]:
    """Give what stands out most, then what does beside it, and so on."""
    n, count = item.left.shape
    free = np.ones(count, dtype=bool)
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.where(
            noise[:, None] > 0.0, np.where(item.known > FILLED, item.left, item.anyhow) / noise[:, None], 0.0
        )
        anyhow = np.where(slow > 0.0, np.minimum(1.0, noise / slow) ** 2, 0.0)
        trust = np.where(item.known > FILLED, 1.0, np.where(_slow(item), anyhow[:, None], 0.0))
        still = np.where(noise[:, None] > 0.0, item.still / noise[:, None], np.nan)

    def expected(start: int, stop: int) -> Array | None:
        found = shape(item, start, stop)
        if found is None:
            return None
        # As the residual is bounded.
        most = BOUND * item.noise[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(noise[:, None] > 0.0, np.clip(found, -most, most) / noise[:, None], 0.0)

    for _ in range(MAX_EVENTS_PER_STRETCH):
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

        def ends_by(joints: NDArray[np.bool_], window: slice = window) -> Ends:
            return event_ends(relative, trust, still, free, window, joints, item.width, expected)

        helping = share >= min(AT_ENDS, best)
        ends = ends_by(helping)
        taken_up = slice(min(ends.start, place), max(ends.stop, place + long))
        if _lasts(item, ends):
            # Of one joint more may be left for longer, as where a push has spoilt its friction.
            short = [j for j in np.flatnonzero(helping) if not _lasts(item, ends_by(np.arange(n) == j))]
            if short:
                share = np.where(np.isin(np.arange(n), short), share, 0.0)
                ends = ends_by(share > 0.0)
        pad = max(1, round(0.1 / item.width))
        free[max(0, taken_up.start - pad) : taken_up.stop + pad] = False
        yield Segment(item, ends, share)
