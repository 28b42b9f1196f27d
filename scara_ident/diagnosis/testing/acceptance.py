"""Acceptance of an effect: the conditions that it must meet, and in words the one that it fails."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.criteria import SelectionCriteria
from scara_ident.diagnosis.testing.candidate_tests import Examination
from scara_ident.effects import Scene
from scara_ident.effects.effect import DOUBT_STDS
from scara_ident.effects.signals import ModelledEffect


@dataclass(frozen=True)
class Decision:
    """Whether a candidate is accepted, and why.

    Attributes
    ----------
    why : str
        In words.
    gain : float
        Gain in cross-validation: what it removes, as a share of that and the rest on its joint; see `gains`.
    tentative : bool
        Not accepted, but worth a look: an arm can have it and it has the required gain, but these recordings are too
        few or too similar to be sure.
    as_no_arm : float
        The gain, if it is significant but its sign or size is impossible for a real arm; otherwise 0. Something that is
        not noise has the same shape as this effect.
    """

    candidate: Candidate
    label: str
    examination: Examination
    accepted: bool
    why: str
    gain: float
    tentative: bool = False
    as_no_arm: float = 0.0

    def refused(self, why: str) -> Decision:
        """Return it as tentative: worth a look, and not believed."""
        return replace(self, accepted=False, tentative=True, why=why)


def decide(
    candidate: Candidate,
    examination: Examination,
    gain: float,
    scene: Scene,
    tried: int,
    criteria: SelectionCriteria,
    chosen: Sequence[Candidate] = (),
) -> Decision:
    """Decide on one candidate.

    Parameters
    ----------
    gain : float
        See `gains`.
    tried : int
        Candidates and scan points tried, for the correction of the p-value.
    chosen : sequence of Candidate
        Effects that are in the model.
    """
    unseen = _unseen(examination, criteria) or _faint(examination, gain, criteria)
    of_no_arm = _inadmissible(candidate, examination, scene, chosen)
    impossible = _unseen(examination, criteria) or of_no_arm
    small = impossible or _small(candidate, examination, scene, gain, criteria)
    seldom = _seldom(candidate, examination, gain, criteria)
    # The first reason that a person would give.
    why = unseen or _insignificant(examination, tried, criteria) or small or seldom
    sure = unseen is None and seldom is None and _insignificant(examination, tried, criteria) is None
    as_no_arm = max(gain, 0.0) if sure and of_no_arm is not None else 0.0
    if _wrong_sign(candidate, examination):
        # The best possible value is zero: it removes nothing, and there is no evidence for it.
        examination, gain = replace(examination, p_value=1.0), min(gain, 0.0)
    words = why or f"removes {gain:.1%} of the squared residual in cross-validation"
    tentative = why is not None and small is None and examination.p_value <= criteria.significant
    return Decision(candidate, candidate.label(scene), examination, why is None, words, gain, tentative, as_no_arm)


def _wrong_sign(candidate: Candidate, examination: Examination) -> bool:
    """Whether the only coefficient certainly has the impossible sign."""
    names, value = candidate.effect.coefficients, examination.value
    if len(names) != 1 or len(value) != 1 or not names[0].positive:
        return False
    return bool(value[0] < -DOUBT_STDS * float(np.sqrt(max(examination.covariance[0, 0], 0.0))))


def _unseen(examination: Examination, criteria: SelectionCriteria) -> str | None:
    if examination.outside < criteria.absorbed:
        return "the model absorbs it, so these recordings cannot show it"
    return None


def _faint(examination: Examination, gain: float, criteria: SelectionCriteria) -> str | None:
    """Return the reason if small errors of the model may cause it; such errors cannot explain most of the residual by one column."""
    if examination.outside >= criteria.min_outside or gain >= criteria.dominant:
        return None
    return (
        f"only {examination.outside:.1e} of it lies outside the model, and small errors of the model may look like it"
    )


def _inadmissible(
    candidate: Candidate, examination: Examination, scene: Scene, chosen: Sequence[Candidate] = ()
) -> str | None:
    std = np.sqrt(np.clip(np.diag(examination.covariance), 0.0, None))
    # Judged with the parameters that the model has with the candidate.
    start, beside = len(scene.value), []
    for item in chosen:
        stop = start + len(item.effect.columns(scene, item.member))
        beside.append(ModelledEffect(item.effect, item.member, tuple(examination.model_value[start:stop].tolist())))
        start = stop
    after = replace(scene, value=examination.model_value[: len(scene.value)], beside=tuple(beside))
    return candidate.effect.inadmissible(after, candidate.member, examination.value, std)


def hopeless(decision: Decision, scene: Scene, criteria: SelectionCriteria) -> str | None:
    """Say why these recordings cannot show a candidate, or no arm can have it with the coefficients found; else None."""
    found = decision.examination
    return (
        _unseen(found, criteria)
        or _faint(found, decision.gain, criteria)
        or _inadmissible(decision.candidate, found, scene)
    )


def _small(
    candidate: Candidate, examination: Examination, scene: Scene, gain: float, criteria: SelectionCriteria
) -> str | None:
    # A correction of the recordings is made however small it is, and however little it removes if it is not negligible.
    small = candidate.effect.negligible(scene, candidate.member, examination.value)
    if small is not None and not candidate.corrects_data:
        return small
    if gain >= criteria.min_gain:
        return None
    least = f"below the detection limit: removes {max(gain, 0.0):.1%} of the squared residual, {criteria.min_gain:.0%} is required"
    if gain <= 0.0 or not candidate.corrects_data:
        return least
    if small is None:
        return None
    # Even if it is very small, its bias of the parameters may exceed their standard deviations.
    settled = candidate.effect.settled(examination.value)
    return None if not settled and displacement(examination) > 1.0 else least


def displacement(examination: Examination) -> float:
    """Return the mean squared bias of the parameters without a candidate, in units of their standard deviations.

    The mean is over as many independent combinations as there are parameters. The model absorbs all but
    `Examination.outside` of the squares of a column; for rows of equal noise the squared bias is to the squared
    significance of the coefficient as inside is to outside. Below 1 the bias is within the stated uncertainty.
    """
    tested, outside = examination.tested, examination.outside
    if outside <= 0.0 or not np.all(np.isfinite(examination.covariance)):
        return 0.0
    squares = float(tested @ np.linalg.pinv(examination.covariance, hermitian=True) @ tested)
    return squares * (1.0 - outside) / outside / max(1, len(examination.model_value))


def _insignificant(examination: Examination, tried: int, criteria: SelectionCriteria) -> str | None:
    alone, corrected = examination.p_value, examination.p_value * tried
    if corrected <= criteria.family_error:
        return None
    # It is worth a look by its own p-value; the corrected one may be 1 and would not explain that.
    if alone <= criteria.significant:
        asked = f"{criteria.family_error / tried:.1e} is required"
        return f"may be chance: p = {alone:.1e} by itself, but with {tried} candidates tried {asked}"
    asked = f"{criteria.family_error:.1g} is required"
    return f"not significant: p = {min(corrected, 1.0):.1e} over the {tried} candidates tried, {asked}"


def _seldom(candidate: Candidate, examination: Examination, gain: float, criteria: SelectionCriteria) -> str | None:
    helps, voting = examination.votes
    # A correction of the recordings is their mean, even if they differ: if it were not made, other effects would stand
    # for it.
    if not voting or candidate.corrects_data or helps >= criteria.min_votes * voting:
        return None
    # With few trajectories one may hardly show the effect; with three of them the share would require all.
    if gain >= criteria.dominant and voting - helps == 1 and helps > 1:
        return None
    return f"in cross-validation it helps in only {helps} of {voting} trajectories"
