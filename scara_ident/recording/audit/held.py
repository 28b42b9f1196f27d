"""Rows that only repeat the row before: a log that is faster than its source, a stale copy now and then, a logger that stalled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.manners import several
from scara_ident.recording.audit.samples import Checked, Finding, Samples, resolution, runs

# A joint moves where its speed is above this share of its rms speed over the recording.
MOVING_SHARE = 0.2
# Rows on either side over which that speed is taken: enough for an encoder's steps to average out.
MOVING_ROWS = 3
# Rows that repeat every channel are a hold, not a coincidence of quantised channels, from this share of the moving rows
# on and where most repetitions of the least repetitive channel fall on them.
HELD_SHARE = 0.02
HELD_OF_REPEATS = 0.5
# Of fewer rows, those count in which a joint goes by more than so many of its smallest steps a row: there its position
# repeats by noise alone, and by chance together with the noise of an effort.
DISTINCT = 4.0
# A log about as fast as its source tells no rate of it: the usual step without copies is longer by more than this.
SLOWER = 1.2
# Such repetitions are none of chance where as many would be seen by chance in fewer than this share of recordings.
CHANCE_LEVEL = 1e-3
# All channels standing still for longer, and then jumping on, is a logger that stalled.
FREEZE_SECONDS = 0.2
# A jump out of a freeze is this many times longer than the steps beside it; an arm that rested moves off smoothly.
FREEZE_JUMP = 3.0


def held_rows(samples: Samples) -> Checked:
    """Leave out rows that only repeat the row before although the arm moves.

    A logger that is faster than its source repeats whole rows; one that stalls does so for long. Encoders repeat
    themselves at low speed, but noisy efforts do not: without efforts nothing is judged.
    """
    if samples.effort is None:
        return samples, []
    same = samples.repeats()
    active = np.flatnonzero(~samples.idle())
    if not same.any() or not len(active):
        return samples, []
    fresh = np.flatnonzero(np.concatenate(([True], ~same)))
    if len(fresh) <= 4 * MOVING_ROWS:
        return samples, []
    moving = np.any(_moving(samples, active, fresh), axis=0)

    start, length = runs(same)
    frozen = _frozen(samples, active, fresh, start, length)
    keep = np.ones(samples.count, dtype=bool)
    found = []
    if frozen.any():
        for first, rows in zip(start[frozen], length[frozen], strict=True):
            keep[first + 1 : first + rows] = False
        count, longest = int((~keep).sum()), int(np.argmax(np.where(frozen, length, 0)))
        said = (
            f"no channel changes, {several(int(frozen.sum()), 'time')}, while the arm moves, the longest "
            f"{samples.interval * length[longest]:.2g} s from {samples.where(int(start[longest]))}: "
            f"{several(count, 'row')} left out"
        )
        found.append(Finding("freeze", said, count))

    copies = _copies(samples, same, keep, moving)
    if np.any(copies):
        count, first = int(np.count_nonzero(copies)), samples.where(int(np.argmax(copies)))
        keep &= ~copies
        # What a logger repeats, it repeats where the arm stands too.
        going = int(np.count_nonzero(copies[1:] & moving[1:] & moving[:-1]))
        when = " while the arm moves" if going == count else f", {going} of them while the arm moves"
        said = f"{count} of {samples.count} rows repeat the row before in every channel{when}, first {first}: left out"
        step = float(np.median(np.diff(samples.time[keep])))
        if step > SLOWER * samples.interval:
            said = f"{said}, the source ran at about {1.0 / step:.4g} Hz"
        found.append(Finding("held_samples", said, count))
    return samples.kept(keep), found


def stale_positions(samples: Samples) -> Checked:
    """Leave out rows with new efforts in which all positions are those of the row before although joints move."""
    if samples.effort is None:
        return samples, []
    same = samples.position[:, 1:] == samples.position[:, :-1]
    fresh = np.flatnonzero(np.concatenate(([True], ~same.all(axis=0))))
    active = np.flatnonzero(~samples.idle())
    if same.all(axis=0).sum() == 0 or len(active) < 2 or len(fresh) <= 4 * MOVING_ROWS:
        return samples, []
    distinct = _distinct(samples, active, fresh)
    stale = distinct.any(axis=0) & same.all(axis=0)
    # One joint repeats by noise alone; two at once, where neither does otherwise, do not.
    judged = np.count_nonzero(distinct, axis=0) >= 2
    others = int(np.count_nonzero(judged & ~stale & np.any(distinct & same[active], axis=0)))
    if _by_chance(int(np.count_nonzero(judged & stale)), others + 1.0):
        return samples, []
    count = int(np.count_nonzero(stale))
    first = samples.where(int(np.argmax(stale)) + 1)
    said = f"{count} of {samples.count} rows have the positions of the row before while the arm moves, first {first}: left out"
    return samples.kept(~np.concatenate(([False], stale))), [Finding("stale_positions", said, count)]


def _moving(samples: Samples, active: NDArray[np.intp], fresh: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Tell during which samples each active joint moves, shape (n, N), from the `fresh` samples alone."""
    travel, rows = _travel(samples, active, fresh)
    speed = travel / np.maximum(samples.time[rows[1]] - samples.time[rows[0]], samples.interval)
    moving = speed > MOVING_SHARE * np.sqrt(np.mean(speed**2, axis=1, keepdims=True))
    over: NDArray[np.bool_] = np.repeat(moving, np.diff(np.concatenate((fresh, [samples.count]))), axis=1)
    return over


def _distinct(samples: Samples, active: NDArray[np.intp], fresh: NDArray[np.intp]) -> NDArray[np.bool_]:
    """Tell in which steps each active joint moves by several of its smallest steps a row, shape (n, N - 1)."""
    travel, _ = _travel(samples, active, fresh)
    smallest = np.array([resolution(samples.position[joint]) for joint in active])[:, None]
    far = np.repeat(
        travel > 2 * MOVING_ROWS * DISTINCT * smallest, np.diff(np.concatenate((fresh, [samples.count]))), axis=1
    )
    far &= _moving(samples, active, fresh)
    return np.asarray(far[:, 1:] & far[:, :-1])


def _travel(samples: Samples, active: NDArray[np.intp], fresh: NDArray[np.intp]) -> tuple[Array, NDArray[np.intp]]:
    """Return how far each active joint goes around each `fresh` sample, shape (n, fresh), and between which samples."""
    count = len(fresh)
    after = fresh[np.minimum(np.arange(count) + MOVING_ROWS, count - 1)]
    before = fresh[np.maximum(np.arange(count) - MOVING_ROWS, 0)]
    return np.abs(samples.position[active][:, after] - samples.position[active][:, before]), np.array([before, after])


def _frozen(
    samples: Samples,
    active: NDArray[np.intp],
    fresh: NDArray[np.intp],
    start: NDArray[np.intp],
    length: NDArray[np.intp],
) -> NDArray[np.bool_]:
    """Tell which runs of equal rows are a stalled logger."""
    end = start + length
    last = samples.count - 1
    long: NDArray[np.bool_] = (
        (samples.time[np.minimum(end, last)] - samples.time[start] > FREEZE_SECONDS) & (start > 0) & (end <= last)
    )
    if not long.any():
        return long
    place = np.searchsorted(fresh, start)
    previous, following = fresh[np.maximum(place - 1, 0)], np.minimum(end, last)
    onward = fresh[np.minimum(place + 2, len(fresh) - 1)]
    position = samples.position[active]
    jump = np.abs(position[:, following] - position[:, start])
    beside = np.maximum(
        np.abs(position[:, start] - position[:, previous]), np.abs(position[:, onward] - position[:, following])
    )
    usual = np.sqrt(np.mean(np.diff(position[:, fresh], axis=1) ** 2, axis=1, keepdims=True))
    frozen: NDArray[np.bool_] = long & (jump > FREEZE_JUMP * np.maximum(beside, usual)).any(axis=0)
    return frozen


def _copies(
    samples: Samples, same: NDArray[np.bool_], keep: NDArray[np.bool_], moving: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Tell which of the rows that are kept only repeat the row before, shape (N,)."""
    both = keep[1:] & keep[:-1]
    held = np.concatenate(([False], same)) & keep
    if _is_hold(samples, same, both & moving[1:] & moving[:-1]):
        return held
    active = np.flatnonzero(~samples.idle())
    fresh = np.flatnonzero(np.concatenate(([True], ~same)))
    distinct = _distinct(samples, active, fresh)
    judged = both & distinct.any(axis=0)
    copied = judged & same
    count = int(np.count_nonzero(copied))
    if not count:
        return np.zeros_like(held)
    # How often a position that moves on and the least repetitive effort repeat in other rows; both at once is chance.
    assert samples.effort is not None
    other, rows = judged & ~same, np.count_nonzero(judged)
    repeated = samples.position[active][:, 1:] == samples.position[active][:, :-1]
    positions = np.count_nonzero(other & np.any(distinct & repeated, axis=0)) + 1.0
    efforts = min(np.count_nonzero(other & (effort[1:] == effort[:-1])) for effort in samples.effort) + 1.0
    if _by_chance(count, positions * efforts / rows):
        return np.zeros_like(held)
    # An arm that rests without noise repeats itself for longer than a log that moves.
    start, length = runs(same)
    in_motion = np.array([copied[first : first + rows - 1].any() for first, rows in zip(start, length, strict=True)])
    long = start[length > np.max(length[in_motion])], length[length > np.max(length[in_motion])]
    for first, rows in zip(*long, strict=True):
        held[first : first + rows] = False
    return held


def _is_hold(samples: Samples, same: NDArray[np.bool_], judged: NDArray[np.bool_]) -> bool:
    """Tell whether most repetitions of the least repetitive channel are copies of a row.

    Where that channel is new the row is no copy, and all others repeat by chance alone: so often they do by chance where it
    repeats too, as those of a coarse encoder do that is read many times within a step.
    """
    from scipy.special import bdtrc

    if not judged.any() or np.mean(same[judged]) < HELD_SHARE:
        return False
    repeats = np.array([(signal[1:] == signal[:-1])[judged] for signal in samples.channels()])
    least = int(np.argmin(np.mean(repeats, axis=1)))
    mine, others = repeats[least], np.all(np.delete(repeats, least, axis=0), axis=0)
    new, count = int(np.count_nonzero(~mine)), int(np.count_nonzero(mine & others))
    chance = (np.count_nonzero(others & ~mine) + 1.0) / (new + 2.0) if new else 0.0
    whole = int(np.count_nonzero(mine))
    if count / whole - chance <= HELD_OF_REPEATS * (1.0 - chance):
        return False
    return bool(bdtrc(count - 1, whole, chance) < CHANCE_LEVEL)


def _by_chance(count: int, expected: float) -> bool:
    """Whether so many may be seen by chance where so many are expected."""
    from scipy.special import pdtrc

    return count < 1 or bool(pdtrc(count - 1, expected) >= CHANCE_LEVEL)
