"""Intervals of recordings in which the last link carries a body, by the torque alone, and the body's parameters.

One body, in any number of intervals of any recordings, beside the base model that all share and offsets of each recording's
own. Where the body is known, each cell of time says by how much the torque is likelier with it than without, and the
likeliest intervals follow (`two_states`); where they are known, so does the body. Both are found in turn, from the single
intervals that explain most. What else may change there is tried beside it (`interval_rivals`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.effects.interval_rivals import MAX_INTERVALS, STRONG_EVIDENCE, Asked, beaten
from scara_ident.effects.last_link_cells import Cells, cells_of
from scara_ident.effects.parameters import Interval
from scara_ident.effects.recording_groups import inverse_of
from scara_ident.effects.signals import Scene
from scara_ident.effects.two_states import instants, likeliest, scatter_of, spans

# The first intervals tried begin and end on a grid of these seconds, and are so many of them long at the most.
GRID_SECONDS, MAX_GRID_STEPS = 1.0, 24
# A search begins where so many of each of so many recordings explain most: from single ones it may end where less is explained.
BEGINS, RECORDINGS = 2, 4
# Where a search begins squares of noise are taken for so much of all that the base model leaves: a body that is carried most of
# the time makes most of that, and what were too dear a change then would never come.
OF_NOISE = 0.03
# A search ends where nothing changes, mostly after four rounds.
ROUNDS = 20
# Nobody takes something up for less than this, s.
MIN_SECONDS = 0.3
# Directions of a body's columns of unit size below this share are not identifiable.
_RANK = 1e-6


@dataclass(frozen=True, eq=False)
class _Found:
    """A body and where it acts.

    Attributes
    ----------
    states, seen, made : list of ndarray, each of shape (C,)
        Of each recording in which cells it acts, and what they say of it, see `Cells.scores`.
    body : ndarray, shape (k,)
    gain : float
        What it explains, twice a logarithm of likelihoods.
    scatter : float
        By how much squares lie above what independent rows of the noise would give.
    price : float
        Twice what all its changes cost, in the same units.
    """

    states: list[Array]
    seen: list[Array]
    made: list[Array]
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
        Standard parameters of a body on the last link, by which it is identified.
    """
    if not scene.columns:
        return ()
    cells = cells_of(scene, shown)
    best = max(_settled(cells, *_begins(cells)), key=lambda item: item.worth, default=None)
    if best is None or best.worth < STRONG_EVIDENCE + len(shown) * _cost(cells):
        return ()
    said = best if _positive(best, shown) else _turned(best)
    if beaten(scene, shown, cells, _asked(cells, said), said.scatter):
        return ()
    return _intervals(scene, cells, said)


def _begins(cells: Cells) -> tuple[list[Array], Array]:
    """Return the s single intervals that explain most, as states (s, C) of each recording and with their bodies (s, k)."""
    value, found = cells.inverse @ cells.aim, []
    for run, item in enumerate(cells.each):
        count = len(item.bounds) - 1
        grid = np.unique(np.linspace(0, count, max(8, int(item.bounds[-1] / GRID_SECONDS)) + 1).astype(int))
        # What all cells before a place of the grid say; of an interval it is the difference.
        squares, across, sums = (_before(table, grid) for table in (item.squares, item.across, item.sums))
        share = (cells.weights / np.maximum(item.rows, 1.0))[:, None] * sums
        across = across - share.swapaxes(1, 2) @ item.whole
        reach, right = across[..., :-1], across[..., -1] - across[..., :-1] @ value
        beside = np.concatenate([reach, sums.swapaxes(1, 2)], axis=2)
        taken = np.concatenate([reach @ cells.inverse, share.swapaxes(1, 2)], axis=2)
        parts = []
        for long in range(1, min(MAX_GRID_STEPS, len(grid) - 2) + 1):
            spread, aim, off, there = (table[long:] - table[:-long] for table in (squares, right, taken, beside))
            parts.append((spread - off @ there.swapaxes(1, 2), aim, grid[:-long], grid[long:]))
        if parts:
            spreads, aims, first, stop = (np.concatenate(item) for item in zip(*parts, strict=True))
            body = _solved(spreads, aims)
            gain = np.sum(body * aims, axis=1)
            found.append([(float(gain[k]), run, first[k], stop[k], body[k]) for k in np.argsort(-gain)[:BEGINS]])
    most = sorted(found, key=lambda own: -own[0][0])[:RECORDINGS]
    # An interval has to pay for two changes; where none does as much as for one, what the base model leaves has no structure.
    begins = [one for own in most for one in own] if most and most[0][0][0] >= STRONG_EVIDENCE + _cost(cells) else []
    states = [np.zeros((len(begins), len(item.bounds) - 1)) for item in cells.each]
    for state, (_, run, *edges, _) in enumerate(begins):
        states[run][state, slice(*edges)] = 1.0
    return states, np.array([body for *_, body in begins])


def _before(table: Array, grid: NDArray[np.intp]) -> Array:
    """Return sums (g, ...) of a table's rows (C, ...) before places."""
    parts = np.add.reduceat(table, grid[:-1], axis=0)
    return np.concatenate([np.zeros_like(parts[:1]), np.cumsum(parts, axis=0)])


def _settled(cells: Cells, states: list[Array], bodies: Array) -> list[_Found]:
    """Return bodies and where they act once neither changes the other, of states (s, C) of each recording to begin with.

    Those of which nothing is left are left out.
    """
    found: list[_Found] = []
    if not len(bodies):
        return found
    scatter = np.full(len(bodies), OF_NOISE)
    seen, made = cells.scores(states, cells.normal(states)[2], bodies)
    for turn in range(ROUNDS):
        new = _likeliest(cells, seen, made, scatter * _cost(cells))
        changes = np.sum([np.count_nonzero(np.diff(state), axis=1) for state in new], axis=0)
        same = np.all([np.all(one == other, axis=1) for one, other in zip(new, states, strict=True)], axis=0)
        squares, right, reach = cells.normal(new)
        states, bodies, known = new, _solved(squares, right), scatter
        seen, made = cells.scores(states, reach, bodies)
        scatter = _scatter(cells, states, seen, made)
        ended = (same & (np.abs(scatter - known) <= 0.1 * known)) | (turn == ROUNDS - 1)
        for k in np.flatnonzero(ended & (changes > 0)):
            price = 2.0 * scatter[k] * _cost(cells) * changes[k]
            own, said, size = ([table[k] for table in tables] for tables in (states, seen, made))
            found.append(_Found(own, said, size, bodies[k], float(bodies[k] @ right[k]), scatter[k], price))
        going = ~ended & (changes > 0)
        states, seen, made = ([table[going] for table in tables] for tables in (states, seen, made))
        bodies, scatter = bodies[going], scatter[going]
        if not len(bodies):
            break
    return found


def _cost(cells: Cells) -> float:
    """Return what a change costs of the likelihood's logarithm: it may be at any cell, and has a size."""
    return float(np.log(sum(len(item.bounds) - 1 for item in cells.each))) + 2.0


def _likeliest(cells: Cells, seen: list[Array], made: list[Array], change: Array) -> list[Array]:
    """Return the likeliest states (s, C) of each recording, by what its cells say of bodies."""
    gains = [row for own, size in zip(seen, made, strict=True) for row in own - 0.5 * size]
    found = iter(likeliest(gains, np.tile(change, len(seen))))
    return [np.array([_long(next(found), item.bounds) for _ in change]) for item in cells.each]


def _long(state: Array, bounds: Array) -> Array:
    """Return it without stretches, or gaps between them, that are too short."""
    state = state.copy()
    for a, b in spans(1.0 - state):
        if bounds[b] - bounds[a] < MIN_SECONDS:
            state[a:b] = 1.0
    for a, b in spans(state):
        if bounds[b] - bounds[a] < MIN_SECONDS:
            state[a:b] = 0.0
    return state


def _scatter(cells: Cells, states: list[Array], seen: list[Array], made: list[Array]) -> Array:
    """Return by how much squares of what is left lie above those of independent rows, over stretches of time, shape (s,)."""
    left = [own - state * size for state, own, size in zip(states, seen, made, strict=True)]
    width = max(float(item.bounds[1]) for item in cells.each)
    return np.array(
        [scatter_of([own[k] for own in left], [own[k] for own in made], width) for k in range(len(made[0]))]
    )


def _asked(cells: Cells, found: _Found) -> Asked:
    """Return the intervals that show most of the body."""
    every = [
        (float(np.sum(size[a:b])), item.name, item.bounds[a], item.bounds[b])
        for item, state, size in zip(cells.each, found.states, found.made, strict=True)
        for a, b in spans(state)
    ]
    result: Asked = {}
    for place, (_, name, start, stop) in enumerate(sorted(every, reverse=True)[:MAX_INTERVALS]):
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
    states, seen = [1.0 - state for state in found.states], [b - a for a, b in zip(found.seen, found.made, strict=True)]
    return replace(found, states=states, seen=seen, body=-found.body)


def _intervals(scene: Scene, cells: Cells, found: _Found) -> tuple[Interval, ...]:
    places = list(scene.start)
    return tuple(
        Interval(places.index(item.name), *times)
        for item, state, own, size in zip(cells.each, found.states, found.seen, found.made, strict=True)
        for times in instants((own - 0.5 * size) / found.scatter, size / found.scatter, state, item.bounds)
    )


def _solved(squares: Array, right: Array) -> Array:
    """Return bodies (s, k) by their normal equations, (s, k, k) and (s, k), within the directions that they tell."""
    return np.asarray((inverse_of(squares, _RANK) @ right[..., None])[..., 0])
