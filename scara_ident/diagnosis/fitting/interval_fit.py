"""Intervals in which an effect acts, fitted to the same rows as all else.

A member's intervals are proposed by means over short cells of time; how they are to be moved follows from the rows within the bands,
those about a rest among them, of a model that has the effect.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns
from scara_ident.diagnosis.fitting.at_estimate import moved_with
from scara_ident.diagnosis.testing.selection_step import SelectionStep, observed
from scara_ident.effects import Interval, Scene
from scara_ident.effects.two_states import instants, scatter_of
from scara_ident.estimation.least_squares import value_and_weights
from scara_ident.motion.sampling import ROWS_PER_PERIOD

# Intervals and all other parameters are fitted in turn; what moves further is less than a row.
ROUNDS = 2


@dataclass(frozen=True, eq=False)
class JointSeen:
    """What the N rows of a joint say of an effect that may act at any time.

    Attributes
    ----------
    time : ndarray, shape (N,)
        Seconds since the recording began.
    owner : ndarray of int, shape (N,)
        Place of the recording among the observations.
    left, made : ndarray, shape (N,)
        Torque that all else leaves, and that the effect would make throughout.
    weight : float
        Of the squares.
    """

    time: Array
    owner: NDArray[np.intp]
    left: Array
    made: Array
    weight: float

    def cells(self, recording: int, width: float, count: int, state: Array | None) -> Array:
        """Return in cells of a recording what speaks for the effect, and its squares, shape (2, count).

        That is beside an offset of the recording's own, none where no state is known yet.

        Parameters
        ----------
        width : float
            Of a cell, s.
        state : ndarray, shape (count,), or None
            Where the effect acts.
        """
        own = self.owner == recording
        cell = np.clip(np.floor(self.time[own] / width + 0.5).astype(int), 0, count - 1)
        left, made = self.left[own], self.made[own]
        if state is not None and len(left):
            left = left - np.mean(left - state[cell] * made)
        parts = (left * made, made**2)
        return np.array([self.weight * np.bincount(cell, part, count) for part in parts])


def seen_by_joints(
    columns: CandidateColumns, scene: Scene, chosen: Sequence[Candidate], which: int, value: Array, weights: Array
) -> list[JointSeen]:
    """Return what the rows of each joint say of one of the effects in a model.

    Parameters
    ----------
    which : int
        Place of the effect among those chosen.
    value : ndarray, shape (k,)
        Parameters of the model with all effects.
    weights : ndarray, shape (n,)
    """
    observations = columns.observations
    names = list(scene.start)
    places = [names.index(item.name) for item in observations.data.recordings]
    throughout = tuple(Interval(place, 0.0, np.inf) for place in places)
    asked = [
        replace(item, member=replace(item.member, intervals=throughout)) if k == which else item
        for k, item in enumerate(chosen)
    ]
    rows = columns.rows(scene, asked)
    stop = np.cumsum([observations.parameters, *(len(next(iter(item.values()))) for item in rows)])
    parts = [
        (place, part, scene.start[item.name])
        for place, item in enumerate(observations.data.recordings)
        for part in item.stretches
        if part.usable
    ]
    found = []
    for j, joint in enumerate(observations.joints):
        left, made = joint.left(value), np.zeros(joint.table.shape[1])
        for k, item in enumerate(rows):
            torque = value[stop[k] : stop[k + 1]] @ item[j] if j in item else 0.0
            if k == which:
                made = made + torque
            else:
                left = left - torque
        time = np.concatenate([part.motion.time[part.kept[j]] - start for _, part, start in parts])
        owner = np.concatenate([np.full(len(part.kept[j]), place) for place, part, _ in parts])
        found.append(JointSeen(time, owner, left, made, float(weights[j] ** 2)))
    return found


def bounds_of_cells(width: float, reach: tuple[float, float]) -> Array:
    """Return the bounds of cells about the rows of a recording, s; each row is in the middle of one, and none is of no length.

    Parameters
    ----------
    width : float
        Between two rows, s.
    reach : tuple of float
        When the recording begins and ends, s.
    """
    count = int(np.ceil(reach[1] / width + 0.5))
    return np.clip(width * (np.arange(count + 1) - 0.5), *reach)


def refined(step: SelectionStep) -> SelectionStep:
    """Return a step whose effects act in intervals that are moved to where the rows see them begin and end."""
    if not any(item.effect.in_intervals for item in step.chosen):
        return step
    for _ in range(ROUNDS):
        value, weights = value_and_weights(observed(step), step.offsets)
        for which, item in enumerate(step.chosen):
            if item.effect.in_intervals:
                seen = seen_by_joints(step.columns, step.scene, step.chosen, which, value, weights)
                chosen = (*step.chosen[:which], _moved(step, item, seen), *step.chosen[which + 1 :])
                step = replace(step, chosen=chosen, scene=moved_with(step.scene, step.chosen, chosen))
    return step


def _moved(step: SelectionStep, item: Candidate, seen: Sequence[JointSeen]) -> Candidate:
    names = list(step.scene.start)
    width = 1.0 / (ROWS_PER_PERIOD * step.scene.band)
    intervals: list[Interval] = []
    for recording, data in enumerate(step.observations.data.recordings):
        place, time = names.index(data.name), data.recording.time
        own = [one for one in item.member.intervals if one.recording == place]
        length = float(time[-1] - time[0])
        bounds = bounds_of_cells(width, (0.0, length))
        count = len(bounds) - 1
        middle = 0.5 * (bounds[1:] + bounds[:-1])
        state = np.zeros(count)
        for one in own:
            state[(middle >= one.start) & (middle < one.stop)] = 1.0
        right, size = np.sum([one.cells(recording, width, count, state) for one in seen], axis=0)
        scatter = max(1.0, scatter_of([right - state * size], [size], width))
        moved = instants((right - 0.5 * size) / scatter, size / scatter, state, bounds)
        # Of one that is shorter than a row nothing is seen.
        same = len(moved) == len(own)
        intervals += [Interval(place, *times) for times in moved] if same else own
    return replace(item, member=replace(item.member, intervals=tuple(intervals)))
