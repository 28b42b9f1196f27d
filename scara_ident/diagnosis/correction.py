"""Effects that are taken out of the recordings, such as a delay, before anything else is said of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.at_estimate import at_estimate
from scara_ident.diagnosis.candidate_tests import coefficients
from scara_ident.diagnosis.candidates import Candidate, CandidateColumns, with_columns
from scara_ident.diagnosis.selection_step import SelectionStep, observed
from scara_ident.effects import Scene
from scara_ident.estimation.least_squares import value_and_weights
from scara_ident.estimation.run_variation import DELAY
from scara_ident.estimation.variation_between import run_variation
from scara_ident.motion.prepared import PreparedData

# Each leaves a tenth or less of what the last one left.
MOST_CORRECTIONS = 6


@dataclass(frozen=True, eq=False)
class Correction:
    """An effect that was taken out of the recordings, such as a delay.

    Attributes
    ----------
    value : ndarray, shape (k,)
        In all; one coefficient for each recording where each has its own, see `Effect.of_each_recording`.
    recordings : tuple of str
        Names of the recordings, in the order of such coefficients.
    """

    candidate: Candidate
    value: Array
    recordings: tuple[str, ...]

    @property
    def of_each(self) -> bool:
        """Whether each recording has a coefficient of its own."""
        return self.candidate.effect.of_each_recording

    def of(self, name: str) -> Array:
        """Return the coefficients of one of the recordings."""
        if not self.of_each:
            return self.value
        place = self.recordings.index(name)
        return self.value[place : place + 1]

    def beside(self, other: Correction | None) -> Correction:
        """Return what both take out of the same recordings; what all have alike counts for each."""
        if other is None:
            return self
        return replace(self if self.of_each else other, value=self.value + other.value)

    def negligible(self, scene: Scene) -> str | None:
        """Say why it is too small to be an effect; None where it is not."""
        return self.candidate.effect.negligible(scene, self.candidate.member, self.value)

    def left(self, scene: Scene) -> tuple[Candidate, float] | None:
        """Return what may be left of it and is no part of an arm, and the band, Hz, that holds that; see `Effect.leaves`."""
        found = self.candidate.effect.leaves(scene, self.candidate.member, self.value)
        return None if found is None else (Candidate(found[0], found[1]), found[2])


def corrected(data: PreparedData, correction: Correction) -> PreparedData:
    """Return recordings without an effect that is taken out of them."""
    effect, member = correction.candidate.effect, correction.candidate.member
    mended = (
        item.with_effort_of(effect.corrected(item.recording, member, correction.of(item.name)))
        for item in data.recordings
    )
    return replace(data, recordings=tuple(mended))


def beside_runs(step: SelectionStep, candidate: Candidate) -> SelectionStep:
    """Return the step that the size of a correction is told beside.

    What runs differ by otherwise is noise to what each recording has of its own, or taken for that where a run moves little.
    """
    if not candidate.effect.of_each_recording:
        return step
    joints = with_columns(step.observations, step.columns.rows(step.scene, step.chosen))
    variation = run_variation(step.observations, joints, step.model.root @ step.model.projected).without(DELAY)
    return replace(step, variation=variation) if variation else step


def taken_out(step: SelectionStep, candidate: Candidate) -> tuple[CandidateColumns, Correction]:
    """Take an effect out of the data, and again while some of it is left.

    A first estimate is one of first order, beside parameters that stand for some of it.

    Returns
    -------
    CandidateColumns
        On the rows of the corrected data.
    Correction
        All that was taken out.
    """
    names = tuple(item.name for item in step.observations.data.recordings)
    step = beside_runs(step, candidate)
    whole, last = np.zeros(len(candidate.effect.columns(step.scene, candidate.member))), np.inf
    for _ in range(MOST_CORRECTIONS):
        (own,) = step.rows(step.scene, [candidate])
        value, _ = coefficients(step.model, own, step.criteria)
        size = float(np.linalg.norm(value))
        if candidate.effect.settled(value) or size >= last:
            break
        whole, last = whole + value, size
        observations = step.observations.with_torque(
            corrected(step.observations.data, Correction(candidate, value, names))
        )
        step = replace(step, columns=step.columns.beside(observations))
        estimate, weights = value_and_weights(observed(step), step.offsets)
        step = replace(step, scene=at_estimate(step.scene, step.chosen, estimate), weights=weights)
    return step.columns, Correction(candidate, whole, names)
