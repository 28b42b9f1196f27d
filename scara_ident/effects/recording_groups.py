"""Groups of recordings in which the last link carries different bodies, by their torque alone.

Each recording says, beside the base model that all share, what mass and first moments its last link has more than in the
others. Recordings that agree are joined, the most alike first by the distance of Mahalanobis (Ward 1963). Where two groups
that are left differ by more than noise and than what recordings of one group differ by, they are proposed. Names and the
order of time take no part.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.effects.links import tool_of
from scara_ident.effects.signals import Scene
from scara_ident.model.offsets import OWN_LEAVE, offset_columns
from scara_ident.motion.motion import Motion

# Probability that noise alone, over all ways to part the recordings, makes two groups.
CHANCE = 0.01
# The last groups to be joined are proposed: four payloads are told apart.
MAX_GROUPS = 3
# What one recording may have more than another, as a multiple of the arm: so weak that only what nobody excites feels it.
PRIOR_RATIO = 3.0
# Slower than this share of a joint's largest speed the direction of friction is not sure.
MIN_SPEED_SHARE = 0.01
# Directions of columns of unit size below this share are rounding.
_RANK = 1e-11
# Fits, each weighted by what the last leaves of each joint.
_ROUNDS = 3


def groups_by_torque(scene: Scene, shown: Sequence[int], unloaded: frozenset[str]) -> tuple[frozenset[str], ...]:
    """Return groups of recordings whose last link has more mass than others', the most different first.

    Parameters
    ----------
    scene : Scene
        With the base model's columns on motions that carry the recorded torque.
    shown : sequence of int
        Standard parameters of a body on the last link by which recordings are told apart.
    unloaded : frozenset of str
        Recordings known to carry nothing: alike, and in no group.
    """
    from scipy.special import chdtrc

    names = [name for name in scene.start if any(motion.name == name for motion in scene.columns)]
    if len(names) < 2:
        return ()
    value, covariance = _more_than_others(scene, names, shown)
    size = len(shown)
    known = frozenset(k for k, name in enumerate(names) if name in unloaded)
    clusters = [frozenset([k]) for k in range(len(names)) if k not in known] + ([known] if known else [])
    for first, second in zip(sorted(known), sorted(known)[1:], strict=False):
        value, covariance = _joined(value, covariance, first, second, size)
    proposals: list[tuple[frozenset[str], float]] = []
    while len(clusters) > 1:
        pairs = list(combinations(clusters, 2))
        apart = [_distance(value, covariance, min(one), min(other), size) for one, other in pairs]
        one, other = pairs[int(np.argmin(apart))]
        # Of two groups the one that carries more; the mass stands first where the torque tells it.
        more = value[min(one) * size] >= value[min(other) * size]
        group = (one if more else other) if not known & (one | other) else (other if known <= one else one)
        proposals.append((frozenset(names[k] for k in group), min(apart)))
        value, covariance = _joined(value, covariance, min(one), min(other), size)
        clusters = [item for item in clusters if item not in (one, other)] + [one | other]
    found = []
    for place in range(len(proposals) - 1, max(-1, len(proposals) - 1 - MAX_GROUPS), -1):
        carrying, height = proposals[place]
        # What recordings of one group differ by beyond white noise.
        scatter = max(1.0, float(np.median([lower for _, lower in proposals[:place]] or [0.0])) / size)
        ways = 2.0 ** (len(names) - 1)
        if chdtrc(size, height / scatter) * ways < CHANCE:
            found.append(carrying)
    return tuple(dict.fromkeys(found))


def _distance(value: Array, covariance: Array, one: int, other: int, size: int) -> float:
    """Return by how many standard deviations, squared, two recordings' last links differ."""
    a, b = (slice(k * size, (k + 1) * size) for k in (one, other))
    difference = value[a] - value[b]
    spread = covariance[a, a] + covariance[b, b] - covariance[a, b] - covariance[b, a]
    return float(difference @ np.linalg.pinv(spread, rcond=_RANK, hermitian=True) @ difference)


def _joined(value: Array, covariance: Array, one: int, other: int, size: int) -> tuple[Array, Array]:
    """Return estimates and covariance under the condition that two recordings' last links are the same."""
    a, b = (slice(k * size, (k + 1) * size) for k in (one, other))
    spread = covariance[:, a] - covariance[:, b]
    gain = spread @ np.linalg.pinv(spread[a] - spread[b], rcond=_RANK, hermitian=True)
    return value - gain @ (value[a] - value[b]), covariance - gain @ spread.T


def _more_than_others(scene: Scene, names: Sequence[str], shown: Sequence[int]) -> tuple[Array, Array]:
    """Return what each recording's last link has more than all have, shape (R k,), and the covariance.

    What all have more is in the base model: only differences count.
    """
    n, p, k, runs = scene.robot.n, len(scene.value), len(shown), len(names)
    products = np.zeros((runs, n, p + k + 1, p + k + 1))
    counts = np.zeros((runs, n))
    for motion, columns in scene.columns.items():
        if motion.name in names:
            run = names.index(motion.name)
            _, sure, rows = rows_of_last_link(scene, motion, columns, shown)
            products[run] += rows @ rows.swapaxes(1, 2)
            counts[run] += np.sum(sure, axis=1)
    prior = np.tile(_prior(scene, shown), runs)
    value, covariance, noise = _fitted(products, counts, prior, p)
    own = _own_offsets(products, offset_columns(scene.model))
    freed = _fitted(own, counts, prior, p)
    # Where runs differ in their offsets, what a load weighs is seen beside these alone.
    return freed[:2] if np.sum((freed[2] / noise) ** 2) < OWN_LEAVE * len(noise) else (value, covariance)


def _own_offsets(products: Array, columns: Sequence[int | None]) -> Array:
    """Return products (R, n, c, c) with an offset of each recording's own, which takes nothing from what its motion says."""
    result = products.copy()
    for joint, column in enumerate(columns):
        if column is not None:
            size = products[:, joint, column, column]
            across = products[:, joint, column] / np.sqrt(np.where(size > 0.0, size, 1.0))[:, None]
            result[:, joint] -= across[:, :, None] * across[:, None, :]
    return result


def _fitted(products: Array, counts: Array, prior: Array, p: int) -> tuple[Array, Array, Array]:
    """Return what each recording has more (R k,), its covariance, and the noise of each joint (n,)."""
    runs, k = len(products), products.shape[-1] - p - 1
    whole = np.maximum(np.sum(counts, axis=0), 1.0)
    noise = np.sqrt(np.maximum(np.sum(products[:, :, -1, -1], axis=0) / whole, np.finfo(float).tiny))
    for _ in range(_ROUNDS):
        # Of each joint's rows in units of its noise.
        each = np.einsum("rjab,j->rab", products, noise**-2.0)
        own, cross = each[:, p:-1, p:-1], each[:, p:-1, :p]
        shared = np.sum(each[:, :p, :p], axis=0)
        inverse = inverse_of(shared, _RANK)
        reach = cross.reshape(runs * k, p)
        precision = -reach @ inverse @ reach.T + np.diag(prior**-2.0)
        for run in range(runs):
            precision[run * k : (run + 1) * k, run * k : (run + 1) * k] += own[run]
        aim = np.sum(each[:, :p, -1], axis=0)
        covariance = np.linalg.inv(precision)
        value = covariance @ (each[:, p:-1, -1].ravel() - reach @ inverse @ aim)
        base = inverse @ (aim - reach.T @ value)
        full = np.array([[*base, *value[run * k : (run + 1) * k], -1.0] for run in range(runs)])
        left = np.einsum("ra,rjab,rb->j", full, products, full)
        noise = np.sqrt(np.maximum(left / whole, np.finfo(float).eps * noise**2))
    return value, covariance, noise


def inverse_of(products: Array, least: float = 1e-9) -> Array:
    """Return inverses of products of columns (..., q, q), within directions of columns of unit size above this share."""
    square = np.diagonal(products, axis1=-2, axis2=-1)
    scale = np.sqrt(np.where(square > 0.0, square, 1.0))
    both = scale[..., :, None] * scale[..., None, :]
    return np.asarray(np.linalg.pinv(products / both, rcond=least, hermitian=True) / both)


def rows_of_last_link(
    scene: Scene, motion: Motion, columns: tuple[Array, ...], shown: Sequence[int]
) -> tuple[Array, NDArray[np.bool_], Array]:
    """Return means over the M half periods of the band, zero where a joint is too slow for its friction to be sure.

    Parameters
    ----------
    scene : Scene
    motion : Motion
        Where it has no torque nothing counts.
    columns : tuple of ndarray
        The base model's on it.
    shown : sequence of int
        Standard parameters of a body on the last link.

    Returns
    -------
    tuple of ndarray
        When each begins, s, shape (M,); of which joints it counts (n, M); and of each joint the base model's columns, those of
        the last link and the torque, shape (n, p + k + 1, M).
    """
    p = len(scene.value)
    step, time, sure = half_periods(scene, motion)
    rows = np.zeros((len(sure), p + len(shown) + 1, len(time)))
    body = tool_of(scene.robot).columns(scene.robot, motion)[:, list(shown)]
    for own, places, held, extra in zip(rows, scene.model.active, columns, body, strict=True):
        own[places], own[p:-1] = means_of(held, step), means_of(extra, step)
    if motion.torque is None:
        return time, np.zeros_like(sure), np.zeros_like(rows)
    rows[:, -1] = means_of(motion.torque, step)
    return time, sure, rows * sure[:, None]


def half_periods(scene: Scene, motion: Motion) -> tuple[int, Array, NDArray[np.bool_]]:
    """Return the M half periods of the band in a motion.

    Returns
    -------
    tuple
        Samples in one, when each begins, s, shape (M,), and in which each joint is so fast that its friction is sure, (n, M).
    """
    step = max(1, int(0.5 * motion.rate / scene.band))
    slow = np.abs(motion.v) < MIN_SPEED_SHARE * scene.speed[:, None]
    sure = means_of(slow, step) == 0.0
    return step, motion.time[: sure.shape[1] * step : step], sure


def means_of(rows: NDArray[Any], step: int) -> Array:
    """Return means (q, M) of rows (q, N) over so many samples each."""
    count = rows.shape[1] // step
    return np.asarray(rows[:, : count * step].reshape(len(rows), count, step) @ np.full(step, 1.0 / step))


def _prior(scene: Scene, shown: Sequence[int]) -> Array:
    """Return the standard deviation of what one recording may have more than another."""
    weight = max(float(np.sum(scene.robot.standard_parameters()[: 10 * scene.robot.n : 10])), 1.0)
    return np.asarray(PRIOR_RATIO * weight * np.array([1.0, *[0.5] * 3, *[0.25] * 6])[list(shown)])
