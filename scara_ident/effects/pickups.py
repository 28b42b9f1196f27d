"""In which recordings the last link takes something up or puts it down midway, and when, told by the torque alone.

Beside the base model that all share, and offsets of a recording's own, a body on the last link from some instant on is
tried in each recording at many instants. One is proposed that explains more than a jump of the offsets, of the friction or of the
torque scales of all joints from then on, and beside any of these more than noise does.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.last_link_cells import duration_of, inverse_of
from scara_ident.effects.links import shared
from scara_ident.effects.recording_groups import rows_of_last_link
from scara_ident.effects.signals import Scene
from scara_ident.model.offsets import offset_columns
from scara_ident.model.terms.friction import Friction

# Instants tried in a recording, even parts of it apart.
PARTS = 16
# Probability that noise alone, over all recordings and instants, makes one.
CHANCE = 0.01
# Directions of columns of unit size below this share are rounding.
_RANK = 1e-9
# Fits, each weighted by what the last leaves of each joint.
_ROUNDS = 3


def taken_up(scene: Scene, shown: Sequence[int]) -> Array:
    """Return in which recordings the last link changes, and how long after their begin, the most certain first.

    Parameters
    ----------
    scene : Scene
        With the base model's columns on motions that carry the recorded torque.
    shown : sequence of int
        Standard parameters of a body on the last link, of which it is told.

    Returns
    -------
    ndarray, shape (m, 2)
        Place of the recording in the scene, and the time in s.
    """
    from scipy.special import chdtrc

    names = [name for name in scene.start if any(motion.name == name for motion in scene.columns)]
    if len(names) < 2:
        # What all recordings do alike is tried at instants of all.
        return np.zeros((0, 2))
    k = len(shown)
    # Products of all recordings at once would be the most that a diagnosis holds: they are made twice.
    whole, counts, value, weights = shared(scene, ("base", tuple(shown)), lambda: _base(scene, names, shown))
    change, families = _changes(scene, value, k)
    body, *others = families
    sets = [body, *others, *([*body, *other] for other in others)]
    gains = np.array([_gains(scene, _products(scene, name, shown), whole, weights, change, sets) for name in names])
    alone, instead, together = gains[:, 0], gains[:, 1 : 1 + len(others)], gains[:, 1 + len(others) :]
    # What it adds beside that which explains most of it, in units of what both leave.
    more = np.min((together - instead) / np.maximum(1.0 - together / np.sum(counts), np.finfo(float).eps), axis=1)
    scatter = max(1.0, float(np.median(more)) / k)
    found = []
    for run, name in enumerate(names):
        place = int(np.argmax(alone[run]))
        chance = float(chdtrc(k, more[run, place] / scatter)) * more.size
        # In the first part it is as good as there throughout.
        if place > 1 and chance < CHANCE and alone[run, place] > np.max(instead[run]):
            instant = duration_of(scene, name) * place / PARTS
            found.append((-alone[run, place], list(scene.start).index(name), instant))
    return np.array([item[1:] for item in sorted(found)]).reshape(-1, 2)


def weights_beside(scene: Scene, names: Sequence[str], shown: Sequence[int]) -> Array:
    """Return the weight of each joint's squares, one over what the base model leaves of a row, shape (n,)."""
    return shared(scene, ("base", tuple(shown)), lambda: _base(scene, names, shown))[3]


def _base(scene: Scene, names: Sequence[str], shown: Sequence[int]) -> tuple[Array, Array, Array, Array]:
    """Return products of columns in all recordings (n, c, c), rows of each joint (n,), and what `_fitted` makes of them."""
    n, p = scene.robot.n, len(scene.value)
    size = p + len(shown) + 1
    products, counts = np.zeros((n, size, size)), np.zeros(n)
    for motion, columns in scene.columns.items():
        if motion.name in names:
            for joint, (time, rows) in enumerate(rows_of_last_link(scene, motion, columns, shown)):
                places = np.array([*scene.model.active[joint], *range(p, size)])
                products[joint][np.ix_(places, places)] += rows @ rows.T
                counts[joint] += len(time)
    return products, counts, *_fitted(products, counts, p)


def _products(scene: Scene, name: str, shown: Sequence[int]) -> Array:
    """Return products of columns in a recording, shape (PARTS, n, c, c).

    Columns are those of the base model, of the last link, and the torque.
    """
    n, p, k = scene.robot.n, len(scene.value), len(shown)
    products = np.zeros((PARTS, n, p + k + 1, p + k + 1))
    for motion, columns in scene.columns.items():
        if motion.name != name:
            continue
        for joint, (time, rows) in enumerate(rows_of_last_link(scene, motion, columns, shown)):
            places = np.array([*scene.model.active[joint], *range(p, p + k + 1)])
            share = (time - scene.start[name]) / duration_of(scene, name)
            parts = np.clip(PARTS * share, 0, PARTS - 1).astype(int)
            for part in np.unique(parts):
                own = rows[:, parts == part]
                products[part, joint][np.ix_(places, places)] += own @ own.T
    return products


def _fitted(whole: Array, counts: Array, p: int) -> tuple[Array, Array]:
    """Return the base model's parameters (p,) and the weight of each joint's squares (n,), by what it leaves."""
    places = [*range(p), whole.shape[-1] - 1]
    squares = whole[:, places][:, :, places]
    least = np.finfo(float).eps * squares[:, -1, -1] + np.finfo(float).tiny
    left = squares[:, -1, -1] + least
    value = np.zeros(p)
    for _ in range(_ROUNDS):
        shared = np.sum(squares / left[:, None, None], axis=0)
        value = inverse_of(shared[:p, :p]) @ shared[:p, -1]
        full = np.append(value, -1.0)
        left = np.maximum(np.einsum("a,jab,b->j", full, squares, full), least)
    return value, counts / left


def _changes(scene: Scene, value: Array, k: int) -> tuple[Array, list[list[int]]]:
    """Return what may change, as sums of columns (n, q, c), and which of them belong together.

    These are a body of k columns, and of all joints the offsets, the friction and the torque scales.
    """
    n, p = scene.robot.n, len(value)
    rubbing = np.zeros(p, dtype=bool)
    for term in scene.model.terms:
        rubbing[scene.model.place(term)] = isinstance(term, Friction)
    change = np.zeros((n, k + 3 * n, p + k + 1))
    change[:, np.arange(k), p + np.arange(k)] = 1.0
    for joint, column in enumerate(offset_columns(scene.model)):
        if column is not None:
            change[joint, k + joint, column] = 1.0
        change[joint, k + n + joint, :p] = np.where(rubbing, value, 0.0)
        change[joint, k + 2 * n + joint, :p] = value
    return change, [list(range(k)), *(list(range(k + start * n, k + (start + 1) * n)) for start in range(3))]


def _gains(
    scene: Scene, own: Array, whole: Array, weights: Array, change: Array, sets: Sequence[Sequence[int]]
) -> Array:
    """Return the squares that sets of changes from the begin of each part on explain, in units of the noise (sets, PARTS).

    That is beside the base model of all recordings and offsets of this one.
    """
    p = len(scene.value)
    shared = np.einsum("j,jab->ab", weights, whole)
    run = weights[:, None, None] * np.sum(own, axis=0)
    offsets = [(joint, column) for joint, column in enumerate(offset_columns(scene.model)) if column is not None]
    size = p + len(offsets)
    base, aim = np.zeros((size, size)), np.zeros(size)
    base[:p, :p], aim[:p] = shared[:p, :p], shared[:p, -1]
    for k, (joint, column) in enumerate(offsets, p):
        base[k, :p] = base[:p, k] = run[joint, column, :p]
        base[k, k], aim[k] = run[joint, column, column], run[joint, column, -1]
    inverse = inverse_of(base)
    after = np.cumsum(own[::-1], axis=0)[::-1]
    along = (weights[:, None, None] * change) @ after
    cross = np.zeros((len(after), change.shape[1], size))
    cross[:, :, :p] = np.sum(along[..., :p], axis=1)
    for k, (joint, column) in enumerate(offsets, p):
        cross[:, :, k] = along[:, joint, :, column]
    left = np.sum(along[..., -1], axis=1) - cross @ (inverse @ aim)
    spread = np.sum(along @ change.transpose(0, 2, 1), axis=1) - cross @ inverse @ cross.transpose(0, 2, 1)
    return np.array([_explained(left[:, places], spread[:, places][:, :, places]) for places in sets])


def _explained(left: Array, spread: Array) -> Array:
    """Return the squares that columns explain, by their products with what is left (s, q) and with each other (s, q, q)."""
    size = np.sqrt(np.maximum(np.diagonal(spread, axis1=1, axis2=2), 0.0))
    scale = np.where(size > 0.0, size, np.inf)
    inverse = np.linalg.pinv(spread / scale[:, :, None] / scale[:, None, :], rcond=_RANK, hermitian=True)
    return np.asarray(np.einsum("sq,sqr,sr->s", left / scale, inverse, left / scale))
