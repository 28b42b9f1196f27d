"""The background of a residual: what it has all along a run, or wherever the motion is the same, is no event."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array, median, medians
from scara_ident.identification.binned_residual import FILLED, NORMAL, STANDSTILL_SHARE, Binned

# Standard deviations at which a sample is bounded where it is asked what other recordings have at the same state.
LOOSE = 40.0
# Shares of the peak speed at which friction may fall with it.
SLOWER = (0.03, 0.08, 0.2)
# Functions of the state taken off at the most, the share of the squared residual that one removes at the least, what harm
# counts against gain, and standard deviations beyond which a bin's weight falls.
MAX_FEATURES, MIN_GAIN, HARM_WEIGHT, INFLUENCE_STDS = 6, 0.02, 0.5, 10.0
# Share of a whole sum that is nothing but its rounding, where all of it is taken off again.
ROUNDING_SHARE = 1e-9
# A trend is fitted to one of so many bins, of which there are so many for each of its columns, in so many rounds.
BIN_STRIDE, MIN_BINS, ROUNDS = 2, 10, 7
# Numbers in the columns of the trends that are fitted together: more would leave the cache.
NUMBERS_AT_ONCE = 2**15
# Starts of that fit, and standard deviations at which Tukey's loss gives up when it chooses among what they end in: half of all may
# be off (Rousseeuw and Yohai 1984).
ROBUST_STARTS, BREAKDOWN_CONSTANT = 12, 1.548
# Fits that are nearer to each other than so many standard deviations of what they leave end in the same.
SAME_FIT_STDS = 0.02
# Seconds of a recording below which its trend is an offset alone.
LONG_ENOUGH = 10.0
# What depends on the state is determined by what is seen in other parts of about so long, s, than an event's own: hardly any event
# reaches beyond one of them and those beside it.
PART = 3.0


def without_trends(stretches: Sequence[Binned]) -> list[Binned]:
    """Take off what its own run has all along: an offset, a share of the load and of friction, and their drift."""
    runs: dict[int, list[Binned]] = {}
    for item in stretches:
        runs.setdefault(item.recording, []).append(item)
    found = [_columns_of_trend(own) for own in runs.values()]
    # Runs of one length together: of one, to call NumPy takes longer than what it does.
    of_shape: dict[tuple[int, ...], list[int]] = {}
    for k, (columns, _, _) in enumerate(found):
        of_shape.setdefault(columns.shape, []).append(k)
    trends: dict[int, Array] = {}
    for places in of_shape.values():
        together = [np.concatenate(part) for part in zip(*(found[k] for k in places), strict=True)]
        at_once = max(1, NUMBERS_AT_ONCE // together[0][0].size)
        starts = range(0, len(together[0]), at_once)
        parts = [_robust_trends(*(part[start : start + at_once] for part in together)) for start in starts]
        trends.update(zip(places, np.split(np.concatenate(parts), len(places)), strict=True))
    taken: dict[int, Array] = {}
    for k, own in enumerate(runs.values()):
        ends = np.cumsum([item.left.shape[1] for item in own])[:-1]
        taken.update(zip(map(id, own), np.split(trends[k], ends, axis=1), strict=True))
    return [item.without(taken[id(item)]) for item in stretches]


def _columns_of_trend(own: Sequence[Binned]) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return the columns of a run's trend, shape (n, k, M), the residual, and where it is known, (n, M) each."""
    seconds = sum(item.left.shape[1] * item.width for item in own)
    v, load = (np.concatenate([item.state[k] for item in own], axis=1) for k in (1, 3))
    left = np.concatenate([item.left for item in own], axis=1)
    known = np.concatenate([item.known for item in own], axis=1) > FILLED
    time = np.concatenate([np.arange(item.left.shape[1]) * item.width for item in own]) / max(seconds, 1.0)
    speed = np.max(np.abs(v), axis=1, keepdims=True)
    sign = _turning(v, np.where(speed > 0.0, speed, 1.0))
    columns = [np.ones_like(v), sign, load, np.broadcast_to(time, v.shape), time * sign]
    return np.stack(columns[: 5 if seconds >= LONG_ENOUGH else 1], axis=1), left, known


def _robust_trends(whole: Array, left: Array, known: NDArray[np.bool_]) -> Array:
    """Return what columns (b, k, M) explain of residuals (b, M) by Tukey's weights of bins; nothing where there is too little."""
    trends, least = np.zeros_like(left), MIN_BINS * whole.shape[1]
    enough = np.count_nonzero(known[:, ::BIN_STRIDE], axis=1) >= least
    if not np.any(enough):
        return trends
    together, target, use = (part[enough][..., ::BIN_STRIDE] for part in (whole, left, known))
    size = np.sqrt(np.mean(together**2, axis=2, keepdims=True))
    size = np.where(size > 0.0, size, 1.0)
    together, target = together / size * use[:, None], target * use
    # Begun by least squares of all, which holds what is so in a run's single turn back, and of all but each of some stretches,
    # so that what happens in one of them alone is seen not to be a trend: of all that these end in, what leaves least.
    starts = np.concatenate([np.ones((1, use.shape[1])), _but_one(use.shape[1])])
    weight = np.broadcast_to(starts, (len(use), *starts.shape))
    products = np.concatenate([together, target[:, None]], axis=1)[:, :, None] * together[:, None]
    beyond, first = _half_above(use)[:, None], np.zeros(len(use), dtype=bool)
    for _ in range(ROUNDS):
        value = _solved(products, weight)
        off = target[:, None] - value @ together
        scale = NORMAL * medians(np.abs(off) + beyond)
        exact = np.any(scale == 0.0, axis=1)
        # Where all end in the same the first stands for them, whatever others that are fitted beside do.
        first |= np.ptp(value, axis=1).max(axis=1) < SAME_FIT_STDS * np.min(scale, axis=1)
        if np.all(first):
            value, off, scale, weight = value[:, :1], off[:, :1], scale[:, :1], weight[:, :1]
        bounded = _tukey(off, 4.0 * np.where(exact[:, None], 1.0, scale)) ** 2
        weight = np.where(exact[:, None, None], weight, bounded) if np.any(exact) else bounded
    best = np.where(first, 0, _least(off, np.min(scale, axis=1)))
    value = np.take_along_axis(value, best[:, None, None], axis=1)
    trends[enough] = ((value / size.transpose(0, 2, 1)) @ whole[enough])[:, 0]
    return trends


def _tukey(off: Array, bound: Array) -> Array:
    """Return ``1 - (off / bound)^2``, 0 beyond the bound, for residuals (b, s, M) and bounds (b, s)."""
    share = off * (1.0 / bound)[:, :, None]
    share *= share
    return np.asarray(np.maximum(np.subtract(1.0, share, out=share), 0.0, out=share))


def _half_above(use: NDArray[np.bool_]) -> Array:
    """Return infinities where bins (b, M) are not used, as many above as below, so that the median is that of the others."""
    above = np.cumsum(~use, axis=1) % 2 == 0
    return np.asarray(np.where(use, 0.0, np.where(above, np.inf, -np.inf)))


def _but_one(count: int) -> Array:
    """Return weights of so many bins that leave out one stretch each, of two neighbours' length, shape (`ROBUST_STARTS` - 1, count)."""
    bounds = np.linspace(0, count, ROBUST_STARTS + 1).astype(int)
    found = np.ones((ROBUST_STARTS - 1, count))
    for row, begin, end in zip(found, bounds[:-2], bounds[2:], strict=True):
        row[begin:end] = 0.0
    return found


def _solved(products: Array, weight: Array) -> Array:
    """Return weighted least squares of b problems, one for each of some weights (b, s, M), shape (b, s, k).

    ``products``, (b, k + 1, k, M), are those of k columns, and then of the target, with the columns.
    """
    problems, _, count, bins = products.shape
    sums = weight @ products.reshape(problems, -1, bins).swapaxes(1, 2)
    sums = sums.reshape(*sums.shape[:2], count + 1, count)
    normal = sums[:, :, :count]
    ridge = 1e-6 * np.trace(normal, axis1=2, axis2=3)[..., None, None] / count
    return np.asarray(np.linalg.solve(normal + (ridge * np.eye(count) + 1e-300), sums[:, :, count, :, None])[..., 0])


def _least(off: Array, scale: Array) -> NDArray[np.intp]:
    """Return which of some residuals (b, s, M) Tukey's loss makes least, or squares where the scale (b,) is 0; shape (b,)."""
    exact = scale == 0.0
    inside = np.sum(_tukey(off, BREAKDOWN_CONSTANT * np.where(exact, 1.0, scale)[:, None]) ** 3, axis=2)
    return np.asarray(np.argmax(np.where(exact[:, None], -np.sum(off**2, axis=2), inside), axis=1))


def without_states(stretches: Sequence[Binned]) -> list[Binned]:
    """Take off what a residual has at the same state of motion at other times, in other recordings and in this one.

    Only where that makes a recording's residual smaller; what happens once is seen at no other time, and stays.
    """
    lengths = [item.taken.shape[1] for item in stretches]
    parts = [max(1, round(count * item.width / PART)) for item, count in zip(stretches, lengths, strict=True)]
    # Where each part begins.
    ends = np.cumsum(lengths)
    starts = np.concatenate(
        [end - count + np.arange(own) * count // own for end, count, own in zip(ends, lengths, parts, strict=True)]
    )
    if len(starts) <= 3:
        return list(stretches)
    # Recordings follow one another.
    owners = np.repeat([item.recording for item in stretches], parts)
    firsts = np.flatnonzero(np.append(True, np.diff(owners)))
    known = np.concatenate([item.known for item in stretches], axis=1) > FILLED
    left = np.concatenate([item.bounded(LOOSE) for item in stretches], axis=1)
    state = [np.concatenate([item.state[k] for item in stretches], axis=1) for k in range(4)]
    taken, shared = np.zeros_like(left), _shared_features(state)
    for j in np.flatnonzero(np.any(known, axis=1)).tolist():
        columns = np.concatenate([_features(state, j), shared])
        taken[j] = _of_others(columns, left[j], known[j], starts, firsts)
    return [item.without(part) for item, part in zip(stretches, np.split(taken, ends[:-1], axis=1), strict=True)]


def _of_others(
    columns: Array, left: Array, known: NDArray[np.bool_], starts: NDArray[np.intp], firsts: NDArray[np.intp]
) -> Array:
    """Return what functions of the state explain of each part by what they do in all but it and those beside it, shape (M,).

    Parts begin at ``starts``, recordings with the parts ``firsts``. One function is added after the other, and all are fitted
    together.
    """
    taken, chosen = np.zeros_like(left), list[int]()
    counts = np.diff(np.append(starts, len(left)))
    lengths = np.diff(np.append(starts[firsts], len(left)))
    for _ in range(MAX_FEATURES):
        off = left - taken
        most = INFLUENCE_STDS * NORMAL * median(np.abs(off[known]))
        use = known * (most / np.maximum(np.abs(off), most or 1.0))
        weighted = columns * use
        scores, squares = (np.add.reduceat(weighted * more, starts, axis=1) for more in (off, columns))
        away = _not_near(squares)
        value = _not_near(scores) / np.where(
            away > ROUNDING_SHARE * np.sum(squares, axis=1, keepdims=True), away, np.inf
        )
        gains = np.add.reduceat(2.0 * value * scores - value**2 * squares, firsts, axis=1)
        # Where it does harm to one recording it is not that recording's doing.
        gains[gains < 0.0] *= HARM_WEIGHT
        best = int(np.argmax(np.sum(gains, axis=1)))
        if best in chosen or np.sum(gains[best]) < MIN_GAIN * np.sum(use * off**2):
            break
        chosen.append(best)
        own = columns[chosen]
        normal = _not_near(np.add.reduceat(own[:, None] * (own * use), starts, axis=2))
        right = _not_near(np.add.reduceat(own * use * left, starts, axis=1))
        least = ROUNDING_SHARE * float(np.sum(own * own * use)) + np.finfo(float).tiny
        normal += (1e-6 * np.maximum(np.trace(normal), 0.0) + least) * np.eye(len(own))[:, :, None]
        values = np.linalg.solve(normal.transpose(2, 0, 1), right.T[:, :, None])[:, :, 0].T
        fitted = np.sum(np.repeat(values, counts, axis=1) * own, axis=0)
        helps = np.add.reduceat(use * (off**2 - (left - fitted) ** 2), starts[firsts]) > 0.0
        taken = np.where(np.repeat(helps, lengths), fitted, taken)
    return taken


def _not_near(sums: Array) -> Array:
    """Return for each part, of sums (..., parts), the sum of all parts but it and those beside it."""
    near = sums.copy()
    near[..., 1:] += sums[..., :-1]
    near[..., :-1] += sums[..., 1:]
    return np.asarray(np.sum(sums, axis=-1, keepdims=True) - near)


def _turning(velocity: Array, most: Array | float) -> Array:
    """Return the sign of a speed that reaches so much, which is whole wherever anything is said of a joint."""
    return np.tanh(velocity / (STANDSTILL_SHARE * np.asarray(most)))


def _features(state: Sequence[Array], joint: int) -> Array:
    """Return functions of its own state that a joint's residual may depend on, of unit size, shape (k, M)."""
    angle, v, _, torque = (part[joint] for part in state)
    speed = max(float(np.max(np.abs(v))), 1e-9)
    sign, own = _turning(v, speed), v / speed
    columns = [sign * np.exp(-np.abs(own) / slow) for slow in SLOWER]
    columns += [np.tanh(2.0 * own), own, own * own * own, own * np.abs(own)]
    columns += [np.sin(2.0 * angle), np.cos(2.0 * angle), sign * np.sin(angle), sign * np.cos(angle)]
    columns += [sign * np.abs(torque), torque, torque * torque * torque, sign * np.minimum(sign * torque, 0.0)]
    return _of_unit_size(np.array(columns))


def _shared_features(state: Sequence[Array]) -> Array:
    """Return functions of the state of all joints that any joint's residual may depend on, of unit size, shape (k, M)."""
    q, v, a, _ = state
    speed = np.maximum(np.max(np.abs(v), axis=1, keepdims=True), 1e-9)
    # A spring, or a cable, pulls by the angle itself.
    away = q - np.mean(q, axis=1, keepdims=True)
    return _of_unit_size(np.concatenate([away, np.sin(q), np.cos(q), _turning(v, speed), v, a]))


def _of_unit_size(columns: Array) -> Array:
    size = np.sqrt(np.mean(columns**2, axis=1, keepdims=True))
    return np.asarray(columns / np.where(size > 0.0, size, 1.0))
