"""What a residual has all along a run, or wherever the motion is the same: no event, and taken off before any is looked for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array, median
from scara_ident.identification.binned_residual import FILLED, NORMAL, Binned

# Standard deviations at which a sample is bounded where it is asked what other recordings have at the same state.
LOOSE = 40.0
# Shares of the peak speed at which friction may fall with it.
SLOWER = (0.03, 0.08, 0.2)
# Functions of the state taken off at the most, the share of the squared residual that one removes at the least, what harm
# counts against gain, and standard deviations beyond which a bin's weight falls.
MOST_FEATURES, LEAST_GAIN, HARM, INFLUENCE = 6, 0.02, 0.5, 10.0
# A trend is fitted to one of so many bins, of which there are so many for each of its columns, in so many rounds.
THIN, LEAST_BINS, ROUNDS = 2, 10, 7
# Seconds of a recording below which its trend is an offset alone.
LONG_ENOUGH = 10.0


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
                v, load = stretches[i].state[1][j], stretches[i].state[3][j]
                time = np.arange(len(v)) * stretches[i].width / max(seconds, 1.0)
                sign = np.tanh(10.0 * v / speed)
                columns = [np.ones_like(v), sign, load, time, time * sign]
                rows.append(np.array(columns[: 5 if seconds >= LONG_ENOUGH else 1]))
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
    if np.sum(use) < LEAST_BINS * len(together):
        return [np.zeros_like(item) for item in left]
    # Begun by least squares: of a run that hardly ever turns back, that is not what stands out.
    weight = use
    for _ in range(ROUNDS):
        weighted = together * weight
        normal = weighted @ together.T
        normal += 1e-6 * np.trace(normal) / len(normal) * np.eye(len(normal)) + 1e-300
        value = np.linalg.solve(normal, weighted @ target)
        off = target - value @ together
        scale = NORMAL * median(np.abs(off[use > 0.0]))
        if scale == 0.0:
            break
        weight = use * np.maximum(0.0, 1.0 - (off / (4.0 * scale)) ** 2) ** 2
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
        scale = NORMAL * median(np.abs(off[known]))
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
    columns = [sign * np.exp(-np.abs(own) / slow) for slow in SLOWER]
    columns += [np.tanh(2.0 * own), own, own**3, own * np.abs(own)]
    columns += [np.sin(2.0 * angle), np.cos(2.0 * angle), sign * np.sin(angle), sign * np.cos(angle)]
    columns += [sign * np.abs(torque), torque, torque**3, sign * np.minimum(sign * torque, 0.0)]
    # A spring, or a cable, pulls by the angle itself.
    away = q - np.mean(q, axis=1, keepdims=True)
    result = np.array([*columns, *away, *np.sin(q), *np.cos(q), *turn, *v, *a])
    size = np.sqrt(np.mean(result**2, axis=1, keepdims=True))
    return np.asarray(result / np.where(size > 0.0, size, 1.0))
