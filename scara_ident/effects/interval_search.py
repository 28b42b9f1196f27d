"""In which intervals of recordings the last link carries a body, told by the torque alone, and what it is.

One body, in any number of intervals of any recordings, beside the base model that all share and offsets of each recording's
own. Where the body is known, each cell of time says by how much the torque is likelier with it than without, and the
likeliest intervals follow (`two_states`); where they are known, so does the body. Both are found in turn, from the single
intervals that explain most. What else may change there is tried beside it (`interval_rivals`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.effects.interval_rivals import MOST_ASKED, STRONG, Asked, beaten
from scara_ident.effects.last_link_cells import Cells, cells_of
from scara_ident.effects.parameters import Interval
from scara_ident.effects.pickups import weights_beside
from scara_ident.effects.signals import Scene
from scara_ident.effects.two_states import instants, likeliest, scatter_of, spans

# The first intervals tried begin and end on a grid of these seconds, and are so many of them long at the most.
GRID, LONGEST = 1.0, 24
# A search begins where so many of each of so many recordings explain most: from single ones it may end where less is explained.
BEGINS, RECORDINGS = 2, 4
# Where a search begins squares of noise are taken for so much of all that the base model leaves: a body that is carried most of
# the time makes most of that, and what were too dear a change then would never come.
OF_NOISE = 0.03
# A search ends where nothing changes, mostly after four rounds.
ROUNDS = 20
# Nobody takes something up for less than this, s.
SHORTEST = 0.3
# Directions of a body's columns of unit size below this share are not told.
_RANK = 1e-6


@dataclass(frozen=True, eq=False)
class _Found:
    """A body and where it acts.

    Attributes
    ----------
    states : list of ndarray, each of shape (C,)
    body : ndarray, shape (k,)
    gain : float
        What it explains, twice a logarithm of likelihoods.
    scatter : float
        By how much squares lie above what independent rows of the noise would give.
    price : float
        Twice what all its changes cost, in the same units.
    """

    states: list[Array]
    body: Array
    gain: float
    scatter: float
    price: float

    @property
    def worth(self) -> float:
        """What it explains beyond its price, in units of the scatter."""
        return (self.gain - self.price) / self.scatter


def carried(scene: Scene, shown: Sequence[int]) -> tuple[Interval, ...]:
    """Return the intervals in which the last link carries one body; none where there is none, or no change within recordings.

    Parameters
    ----------
    scene : Scene
        With the base model's columns on motions that carry the recorded torque.
    shown : sequence of int
        Standard parameters of a body on the last link, of which it is told.
    """
    names = [name for name in scene.start if any(motion.name == name for motion in scene.columns)]
    if not names:
        return ()
    cells = cells_of(scene, shown, names, weights_beside(scene, names, shown))
    tried = [_settled(cells, start) for start in _begins(cells)]
    best = max((item for item in tried if item is not None), key=lambda item: item.worth, default=None)
    if best is None or best.worth < STRONG + len(shown) * _cost(cells):
        return ()
    said = best if _positive(best, shown) else _turned(best)
    if beaten(scene, shown, cells, _asked(cells, said), said.scatter):
        return ()
    return _intervals(scene, cells, said)


def _begins(cells: Cells) -> list[tuple[list[Array], Array]]:
    """Return the single intervals that explain most, each as states and with its body."""
    value, found = cells.inverse @ cells.aim, []
    for run, item in enumerate(cells.each):
        count = len(item.bounds) - 1
        grid = np.unique(np.linspace(0, count, max(8, int(item.bounds[-1] / GRID)) + 1).astype(int))
        last = len(grid) - 1
        pairs = [(a, b) for a in range(last) for b in range(a + 1, min(last, a + LONGEST) + 1) if b - a < last]
        first, stop = np.array(pairs).T
        squares, across, sums = (_between(table, grid, first, stop) for table in (item.squares, item.across, item.sums))
        share = (cells.weights / np.maximum(item.rows, 1.0))[:, None] * sums
        squares = squares - share.transpose(0, 2, 1) @ sums
        across = across - share.transpose(0, 2, 1) @ item.whole
        reach = across[:, :, :-1]
        right = across[:, :, -1] - reach @ value
        body = _solved(squares - reach @ cells.inverse @ reach.transpose(0, 2, 1), right)
        gain = np.sum(body * right, axis=1)
        own = []
        for k in np.argsort(-gain)[:BEGINS]:
            states = [np.zeros(len(other.bounds) - 1) for other in cells.each]
            states[run][grid[first[k]] : grid[stop[k]]] = 1.0
            own.append((float(gain[k]), states, body[k]))
        found.append(own)
    found.sort(key=lambda one: -one[0][0])
    # An interval has to pay for two changes; where none does as much as for one, what the base model leaves has no structure.
    if not found or found[0][0][0] < STRONG + _cost(cells):
        return []
    return [(states, body) for own in found[:RECORDINGS] for _, states, body in own]


def _between(table: Array, grid: NDArray[np.intp], first: NDArray[np.intp], stop: NDArray[np.intp]) -> Array:
    total = np.concatenate([np.zeros((1, *table.shape[1:])), np.cumsum(table, axis=0)])[grid]
    return np.asarray(total[stop] - total[first])


def _settled(cells: Cells, start: tuple[list[Array], Array]) -> _Found | None:
    """Return the body and where it acts once neither changes the other; None where nothing is left of it."""
    states, body = start
    scatter, gain, price = OF_NOISE, 0.0, 0.0
    for _ in range(ROUNDS):
        change = scatter * _cost(cells)
        new = [
            _long(state, item.bounds)
            for state, item in zip(_likeliest(cells, states, body, change), cells.each, strict=True)
        ]
        changes = sum(int(np.count_nonzero(np.diff(state))) for state in new)
        if changes == 0:
            return None
        squares, right, _ = cells.normal(new)
        body = _solved(squares[None], right[None])[0]
        same = all(np.array_equal(one, other) for one, other in zip(new, states, strict=True))
        states, gain = new, float(body @ right)
        known, scatter = scatter, _scatter(cells, states, body)
        price = 2.0 * scatter * _cost(cells) * changes
        if same and abs(scatter - known) <= 0.1 * known:
            break
    return _Found(states, body, gain, scatter, price)


def _cost(cells: Cells) -> float:
    """Return what a change costs of the likelihood's logarithm: it may be at any cell, and has a size."""
    return float(np.log(sum(len(item.bounds) - 1 for item in cells.each))) + 2.0


def _likeliest(cells: Cells, states: list[Array], body: Array, change: float) -> list[Array]:
    seen, made = cells.scores(states, body)
    return likeliest([own - 0.5 * size for own, size in zip(seen, made, strict=True)], change)


def _long(state: Array, bounds: Array) -> Array:
    """Return it without stretches, or gaps between them, that are too short."""
    state = state.copy()
    for a, b in spans(1.0 - state):
        if bounds[b] - bounds[a] < SHORTEST:
            state[a:b] = 1.0
    for a, b in spans(state):
        if bounds[b] - bounds[a] < SHORTEST:
            state[a:b] = 0.0
    return state


def _scatter(cells: Cells, states: list[Array], body: Array) -> float:
    """Return by how much squares of what is left lie above those of independent rows, over stretches of time."""
    seen, made = cells.scores(states, body)
    left = [own - state * size for state, own, size in zip(states, seen, made, strict=True)]
    return scatter_of(left, made, max(float(item.bounds[1]) for item in cells.each))


def _asked(cells: Cells, found: _Found) -> Asked:
    """Return the intervals that show most of the body."""
    _, made = cells.scores(found.states, found.body)
    every = [
        (float(np.sum(size[a:b])), item.name, item.bounds[a], item.bounds[b])
        for item, state, size in zip(cells.each, found.states, made, strict=True)
        for a, b in spans(state)
    ]
    result: Asked = {}
    for place, (_, name, start, stop) in enumerate(sorted(every, reverse=True)[:MOST_ASKED]):
        result.setdefault(name, []).append((place, float(start), float(stop)))
    return result


def _positive(found: _Found, shown: Sequence[int]) -> bool:
    """Whether it is said as it was found, and not as the opposite body in all other times.

    Most recordings in which nothing changes are without it; where most change, its mass, or else its inertia, is positive.
    """
    still = [float(state[0]) for state in found.states if np.all(state == state[0])]
    if 2 * len(still) >= len(found.states) and 2.0 * sum(still) != len(still):
        return 2.0 * sum(still) < len(still)
    return next((found.body[place] for place, k in enumerate(shown) if k in (0, 4, 6, 9)), 1.0) >= 0.0


def _turned(found: _Found) -> _Found:
    """Return the opposite body in all other times: what is always there the base model has."""
    return _Found([1.0 - state for state in found.states], -found.body, found.gain, found.scatter, found.price)


def _intervals(scene: Scene, cells: Cells, found: _Found) -> tuple[Interval, ...]:
    places = list(scene.start)
    seen, made = cells.scores(found.states, found.body)
    return tuple(
        Interval(places.index(item.name), *times)
        for item, state, own, size in zip(cells.each, found.states, seen, made, strict=True)
        for times in instants((own - 0.5 * size) / found.scatter, size / found.scatter, state, item.bounds)
    )


def _solved(squares: Array, right: Array) -> Array:
    """Return bodies by their normal equations, (s, k, k) and (s, k), within the directions that they tell."""
    size = np.sqrt(np.maximum(np.diagonal(squares, axis1=1, axis2=2), 0.0))
    scale = np.where(size > 0.0, size, np.inf)
    inverse = np.linalg.pinv(squares / scale[:, :, None] / scale[:, None, :], rcond=_RANK, hermitian=True)
    return np.asarray(np.einsum("skl,sl->sk", inverse, right / scale) / scale)
