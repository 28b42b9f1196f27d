"""Intervals of a held-out recording in which an effect acts: for each joint by the torque of the others.

No torque takes part in the choice of where it is itself predicted with the effect, so that errors stay those of recordings that
no choice has seen; of an effect that loads one joint alone nothing is predicted there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns, columns_at_hand
from scara_ident.diagnosis.fitting.interval_fit import JointSeen, bounds_of_cells, seen_by_joints
from scara_ident.effects import Interval, Scene
from scara_ident.effects.two_states import instants, likeliest, scatter_of
from scara_ident.estimation.observations import Observations
from scara_ident.motion.sampling import ROWS_PER_PERIOD

# Rounds in which an offset of the recording's own and intervals are found in turn.
ROUNDS = 6


def intervals_by_others(
    one: Observations, scene: Scene, chosen: Sequence[Candidate], which: int, value: Array, weights: Array
) -> tuple[tuple[Interval, ...], tuple[Interval, ...]]:
    """Return the intervals of a recording in which an effect acts on each joint, as the others tell, and as all tell.

    Parameters
    ----------
    one : Observations
        Of the base model, of one recording.
    chosen : sequence of Candidate
        The effects found, with what is known already of where they act.
    which : int
        Place of the effect that is asked for.
    value : ndarray, shape (k,)
        Parameters of the model with all effects.
    weights : ndarray, shape (n,)
    """
    here = replace(scene, columns=columns_at_hand(one))
    seen = seen_by_joints(CandidateColumns(one), here, chosen, which, value, weights)
    place, time = list(scene.start).index(one.name), one.data.recordings[0].recording.time
    first, last = (float(edge) - scene.start[one.name] for edge in time[[0, -1]])

    def intervals(joints: Sequence[JointSeen], joint: int | None) -> list[Interval]:
        return [Interval(place, *times, joint) for times in _active_times(joints, (first, last), scene.band)]

    apart = [item for j in range(len(seen)) for item in intervals([*seen[:j], *seen[j + 1 :]], j)]
    return tuple(apart), tuple(intervals(seen, None))


def _active_times(
    seen: Sequence[JointSeen], reach: tuple[float, float], band: float
) -> list[tuple[float, float, float, float]]:
    """Return when an effect begins and ends to act, and how sure that is, by the rows of some joints."""
    width = 1.0 / (ROWS_PER_PERIOD * band)
    bounds = bounds_of_cells(width, reach)
    count = len(bounds) - 1
    state: Array | None = None
    gains, sizes, scatter = np.zeros(count), np.zeros(count), 1.0
    for _ in range(ROUNDS if seen else 0):
        right, size = np.sum([item.cells(0, width, count, state) for item in seen], axis=0)
        gains, sizes = (right - 0.5 * size) / scatter, size / scatter
        new = likeliest([gains], float(np.log(count)) + 2.0)[0]
        if state is not None and np.array_equal(new, state):
            break
        state = new
        scatter = max(1.0, scatter_of([right - state * size], [size], width))
    return [] if state is None else instants(gains, sizes, state, bounds)


def words_of(found: Sequence[Interval]) -> str:
    """Say in which intervals."""
    said = [f"from {item.start:.2f} to {item.stop:.2f} s" for item in found]
    return ", ".join(said) if said else "nowhere"
