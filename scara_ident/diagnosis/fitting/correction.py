"""Effects that correct the recordings, such as a delay, before others are tested."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Candidate, CandidateColumns, with_columns
from scara_ident.diagnosis.fitting.at_estimate import at_estimate
from scara_ident.diagnosis.testing.candidate_tests import coefficients, examine
from scara_ident.diagnosis.testing.selection_step import SelectionStep, observed
from scara_ident.effects import Scene
from scara_ident.estimation.least_squares import value_and_weights
from scara_ident.estimation.run_variation import DELAY
from scara_ident.estimation.variation_between import run_variation
from scara_ident.motion.prepared import PreparedData

# Each leaves a tenth or less of what the last one left.
MAX_CORRECTIONS = 6
# Of a column that is three quarters noise an estimate sees a quarter of what is there. What a step is scaled up by ends here, or one
# that the data hardly answer would go anywhere.
MIN_RELIABILITY = 0.25


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


def correction_step(step: SelectionStep, candidate: Candidate) -> SelectionStep:
    """Return the step that the size of a correction is estimated beside.

    What each recording has of its own is estimated in the lower part of the band: a controller answers the noise of positions, which
    makes another of the same size in every recording of a kind of motion. What runs differ by otherwise is noise to it, or taken
    for it where a run moves little.

    Raises
    ------
    RecordingError
        Where a recording is too short for that part.
    """
    if not candidate.effect.of_each_recording:
        return step
    columns = step.columns.at(lower_bands(step))
    below = replace(step, columns=columns, variation=None)
    observations, value = columns.observations, step.model.root @ step.model.projected
    joints = with_columns(observations, columns.rows(step.scene, step.chosen))
    variation = run_variation(observations, joints, value).without(DELAY)
    return replace(below, variation=variation) if variation else below


def lower_bands(step: SelectionStep) -> tuple[float, ...]:
    """Return the lower part of the band of every joint, Hz."""
    return tuple(step.criteria.lower_band * (band or step.scene.band) for band in step.observations.data.bands)


def drawn_together(value: Array, covariance: Array) -> Array:
    """Return what each recording has of its own, drawn to the mean of all as far as it is unsure (Efron and Morris 1975).

    Parameters
    ----------
    value : ndarray, shape (k,)
    covariance : ndarray, shape (k, k)
        Of these; what all are unsure by alike draws none of them to another. No variance is that of one that tells nothing.
    """
    determined = np.diag(covariance) > 0.0
    count = int(np.count_nonzero(determined))
    if count < 2:
        return np.full(len(value), np.mean(value[determined]) if count else 0.0)
    own, whole = value[determined], covariance[np.ix_(determined, determined)]

    def contrasts(variance: Array) -> tuple[Array, Array]:
        """Return the precision of what lies off the mean, and the share of each in the mean."""
        sure = np.linalg.pinv(variance, hermitian=True)
        shares = np.sum(sure, axis=0) / np.sum(sure)
        return sure - np.sum(sure) * np.outer(shares, shares), shares

    # How far recordings differ, by moments (DerSimonian and Laird 1986).
    within, _ = contrasts(whole)
    between = max(0.0, float(own @ within @ own) - (count - 1)) / float(np.trace(within))
    within, shares = contrasts(whole + between * np.eye(count))
    drawn = np.full(len(value), float(shares @ own))
    drawn[determined] += between * (within @ own)
    return drawn


def still_there(step: SelectionStep, candidate: Candidate, whole: Array) -> Array:
    """Return what is to be taken out of recordings that so much was taken out of.

    Parameters
    ----------
    step : SelectionStep
        See `correction_step`.
    candidate : Candidate
    whole : ndarray, shape (k,)
    """
    (own,) = step.rows(step.scene, [candidate])
    if not candidate.effect.of_each_recording:
        return coefficients(step.model, own, step.criteria)[0]
    (found,) = examine(step.model, [own], step.criteria)
    return drawn_together(whole + found.value, found.covariance) - whole


def taken_out(step: SelectionStep, candidate: Candidate) -> tuple[CandidateColumns, Correction]:
    """Take an effect out of the data, and again while some of it is left.

    A first estimate is one of first order, beside parameters that stand for some of it, and the noise of positions in its column
    makes it too small, as it does every further one. The end is not too small, since what noise makes has nothing in common with its
    own rate; how much of a step the next estimate sees says how far away the end is (secant method).

    Returns
    -------
    CandidateColumns
        On the rows of the corrected data.
    Correction
        All that was taken out.
    """
    names = tuple(item.name for item in step.observations.data.recordings)
    whole, last, whole_band = np.zeros(len(candidate.effect.columns(step.scene, candidate.member))), np.inf, step
    step = correction_step(step, candidate)
    seen, before, moved = 1.0, whole, whole
    for _ in range(MAX_CORRECTIONS):
        value = still_there(step, candidate, whole)
        size = float(np.linalg.norm(value))
        if np.any(moved):
            seen = max(MIN_RELIABILITY, float((before - value) @ moved) / float(moved @ moved))
        if candidate.effect.settled(value / seen) or size >= last:
            break
        before, moved, last = value, value / seen, size
        whole = whole + moved
        observations = step.observations.with_torque(
            corrected(step.observations.data, Correction(candidate, moved, names))
        )
        step = replace(step, columns=step.columns.beside(observations))
        estimate, weights = value_and_weights(observed(step), step.offsets)
        step = replace(step, scene=at_estimate(step.scene, step.chosen, estimate), weights=weights)
    found = Correction(candidate, whole, names)
    if not found.of_each:
        return step.columns, found
    observations = whole_band.observations
    return whole_band.columns.beside(observations.with_torque(corrected(observations.data, found))), found
