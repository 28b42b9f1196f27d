"""Effects that are taken out of the recordings, such as a delay, before anything else is said of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.at_estimate import at_estimate
from scara_ident.diagnosis.candidate_tests import coefficients
from scara_ident.diagnosis.candidates import Candidate, CandidateColumns
from scara_ident.diagnosis.selection_step import SelectionStep, observed
from scara_ident.effects import Scene
from scara_ident.estimation.least_squares import value_and_weights
from scara_ident.motion.prepared import PreparedData

# Each leaves a tenth or less of what the last one left.
MOST_CORRECTIONS = 6


@dataclass(frozen=True, eq=False)
class Correction:
    """An effect that was taken out of the recordings, such as a delay.

    Attributes
    ----------
    value : ndarray, shape (k,)
        In all.
    """

    candidate: Candidate
    value: Array

    def negligible(self, scene: Scene) -> str | None:
        """Say why it is too small to be an effect; None where it is not."""
        return self.candidate.effect.negligible(scene, self.candidate.member, self.value)

    def left(self, scene: Scene) -> tuple[Candidate, float] | None:
        """Return what may be left of it and is no part of an arm, and the band, Hz, that holds that; see `Effect.leaves`."""
        found = self.candidate.effect.leaves(scene, self.candidate.member, self.value)
        return None if found is None else (Candidate(found[0], found[1]), found[2])


def corrected(data: PreparedData, candidate: Candidate, value: Array) -> PreparedData:
    """Return recordings without an effect that is taken out of them."""
    effect, member = candidate.effect, candidate.member
    mended = (item.with_effort_of(effect.corrected(item.recording, member, value)) for item in data.recordings)
    return replace(data, recordings=tuple(mended))


def taken_out(step: SelectionStep, candidate: Candidate) -> tuple[CandidateColumns, Array]:
    """Take an effect out of the data, and again while some of it is left.

    A first estimate is one of first order, beside parameters that stand for some of it.

    Returns
    -------
    CandidateColumns
        On the rows of the corrected data.
    ndarray, shape (k,)
        All that was taken out.
    """
    whole, last = np.zeros(len(candidate.effect.columns(step.scene, candidate.member))), np.inf
    for _ in range(MOST_CORRECTIONS):
        (own,) = step.rows(step.scene, [candidate])
        value, _ = coefficients(step.model, own, step.criteria)
        size = float(np.linalg.norm(value))
        if candidate.effect.settled(value) or size >= last:
            break
        whole, last = whole + value, size
        observations = step.observations.with_torque(corrected(step.observations.data, candidate, value))
        step = replace(step, columns=step.columns.beside(observations))
        estimate, weights = value_and_weights(observed(step), step.offsets)
        step = replace(step, scene=at_estimate(step.scene, step.chosen, estimate), weights=weights)
    return step.columns, whole
