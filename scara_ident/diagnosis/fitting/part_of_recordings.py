"""A selection step on a part of the recordings that determines its effects: enough for finding other minima."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import CandidateColumns, columns_at_hand
from scara_ident.diagnosis.testing.selection_step import SelectionStep
from scara_ident.estimation.run_offsets import offsets_on

# Every effect is determined as well as by so many seconds of all recordings, s: of the slowest resonance that is tried a hundred periods.
ENOUGH_SECONDS = 20.0


def on_part(step: SelectionStep) -> SelectionStep:
    """Return the step on the fewest recordings that tell each of its effects well; the step itself where that takes all."""
    columns = step.columns
    places = _telling(step)
    if len(places) == len(columns.observations.data.recordings):
        return step
    own = CandidateColumns(columns.observations.of(places))
    return _on(step, own)


def on_all(part: SelectionStep, step: SelectionStep) -> SelectionStep:
    """Return the effects of a step on part of the recordings, as they were fitted there, on those of another step."""
    return _on(part, step.columns)


def _on(step: SelectionStep, columns: CandidateColumns) -> SelectionStep:
    scene = replace(step.scene, columns=columns_at_hand(columns.observations))
    return replace(step, scene=scene, columns=columns, variation=offsets_on(columns.observations, step.offsets))


def _telling(step: SelectionStep) -> list[int]:
    """Return the places of the recordings that tell the effects: those first that tell most of them."""
    observations = step.observations
    seconds = sum(part.samples / part.rate for part in observations.data.stretches)
    strengths = _strengths(step)
    shares = strengths / np.maximum(np.sum(strengths, axis=1, keepdims=True), np.finfo(float).tiny)
    order = np.argsort(-np.sum(shares, axis=0), kind="stable")
    enough = seconds * np.min(np.cumsum(shares[:, order], axis=1), axis=0) >= ENOUGH_SECONDS
    return sorted(order[: int(np.argmax(enough)) + 1 if np.any(enough) else None].tolist())


def _strengths(step: SelectionStep) -> Array:
    """Return what each recording tells of each effect, shape (effects, recordings): the weighted square of its columns."""
    observations = step.observations
    found = np.zeros((len(step.chosen), len(observations.data.recordings)))
    for own, rows in zip(found, step.columns.rows(step.scene, step.chosen), strict=True):
        for joint, columns in rows.items():
            squares = observations.joints[joint].by_block(np.sum(columns**2, axis=0))
            np.add.at(own, observations.owner, step.weights[joint] ** 2 * squares)
    return found
