"""Segmentation of time into two states, by the likelihood of cells and a penalty for each change.

Of all ways to be in one of two states the likeliest, by dynamic programming (Viterbi 1967), and how sure its instants are.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.arrays import Array

# Stretches within which what is left may remember itself, s: friction that is modelled badly lasts as long as a move.
MEMORY = 0.5


def likeliest(gains: Sequence[Array], change: float | Array) -> list[Array]:
    """Return in which cells of each recording something acts, of shape (C,), 0 or 1.

    Parameters
    ----------
    gains : sequence of ndarray, each of shape (C,)
        What the logarithm of the likelihood gains where it acts in a cell.
    change : float or ndarray, shape (len(gains),)
        What it loses by each change of the state within a recording.
    """
    longest, runs = max(map(len, gains), default=0), len(gains)
    table = np.zeros((longest, runs))
    for run, own in enumerate(gains):
        table[: len(own), run] = own
    # By how much it is likelier before each cell, and after the last, that it acts: of both states only this counts.
    lead, bounded = np.zeros((longest + 1, runs)), np.zeros(runs)
    most = np.broadcast_to(np.asarray(change, dtype=float), runs)
    least = -most
    for cell in range(longest):
        np.minimum(np.maximum(lead[cell], least, out=bounded), most, out=bounded)
        np.add(bounded, table[cell], out=lead[cell + 1])
    # Where one is likelier by more than a change costs it is this, whatever comes; else as after the next such place.
    place = np.where(np.abs(lead) > most, np.arange(longest + 1)[:, None], longest)
    place = np.minimum.accumulate(place[::-1])[::-1]
    states = (np.take_along_axis(lead, place, axis=0) > 0.0).astype(float)
    return [states[1 : len(own) + 1, run] for run, own in enumerate(gains)]


def spans(state: Array) -> list[tuple[int, int]]:
    """Return the first cell, and that after the last, of each stretch in which something acts; state of shape (C,)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0.0], state, [0.0]])))
    return [(int(a), int(b)) for a, b in edges.reshape(-1, 2)]


def instants(gains: Array, sizes: Array, state: Array, bounds: Array) -> list[tuple[float, float, float, float]]:
    """Return when each stretch begins and ends, and the standard deviation of both, s.

    Parameters
    ----------
    gains, state : ndarray, shape (C,)
        As `likeliest` takes and gives them, of one recording.
    sizes : ndarray, shape (C,)
        Twice what a cell would gain where it acts and nothing else is left there: of one in which it begins that is less.
    bounds : ndarray, shape (C + 1,)
        Times of the cells, s.

    Returns
    -------
    list of tuple
        Begin, end, and their standard deviations; 0 where the recording begins or ends.

    Notes
    -----
    The mean over all places between the changes before and after, weighted by their likelihood: within what tells nothing,
    as a rest, it is the middle, known as badly as that is long.
    """
    # What all places of a change have in common is left out: a change at a place gains all before it, or all after it.
    total = np.concatenate([[0.0], np.cumsum(gains)])
    edges = [edge for span in spans(state) for edge in span]
    between = [0, *edges, len(state)]
    found = []
    for k, edge in enumerate(edges):
        if edge in (0, len(state)):
            found.append((float(bounds[edge]), 0.0))
            continue
        places = np.arange(between[k] + 1, between[k + 2]) if between[k] + 1 < between[k + 2] else np.array([edge])
        odds = (-1.0 if k % 2 == 0 else 1.0) * total[places]
        chance = np.exp(odds - np.max(odds))
        chance /= np.sum(chance)
        mean = float(chance @ bounds[places])
        spread = float(chance @ (bounds[places] - mean) ** 2)
        # It is somewhere within a cell.
        width = float(bounds[edge] - bounds[edge - 1])
        if spread < (0.5 * width) ** 2:
            # The cells on either side are full, or empty, in part: half of one by prior, known to its whole.
            inside = slice(edge - 1, edge + 1)
            acts = np.clip((gains + 0.5 * sizes)[inside] / (sizes[inside] + 1.0), 0.0, 1.0)
            late = acts if state[edge] == 0.0 else 1.0 - acts
            mean = float(bounds[edge - 1] + width * np.sum(late))
        found.append((mean, float(np.sqrt(spread + width**2 / 12.0))))
    return [(a, b, std, other) for (a, std), (b, other) in zip(found[::2], found[1::2], strict=True)]


def scatter_of(left: Sequence[Array], sizes: Sequence[Array], width: float) -> float:
    """Return by how much squares of what is left lie above those of independent rows; 1 where nothing says it.

    Parameters
    ----------
    left, sizes : sequence of ndarray, each of shape (C,)
        Of the cells of each recording the products of what acts with what is left beside it, and its squares.
    width : float
        Of a cell, s.
    """
    squares = 0.0
    for own in left:
        starts = np.arange(0, len(own), max(1, round(MEMORY / width)))
        squares += float(np.sum(np.add.reduceat(own, starts) ** 2))
    expected = float(sum(np.sum(own) for own in sizes))
    return max(squares / expected, float(np.finfo(float).eps)) if expected > 0.0 else 1.0
