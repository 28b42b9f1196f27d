"""Letting an effect in: every condition that it must meet, and the words for the one that it fails."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scara_ident.diagnosis.candidate_tests import WEAK, Examination
from scara_ident.diagnosis.candidates import Candidate
from scara_ident.effects import Scene
from scara_ident.effects.spanned import ABSORBED

# Probability of letting any effect in when nothing is missing, over all candidates tried.
FAMILY_ERROR = 0.01
# Share of the squared residual of its joints that an effect must remove on rows that it was not fitted to.
LEAST_GAIN = 0.05
# Share of the voting folds in which it must help.
LEAST_VOTES = 0.75


@dataclass(frozen=True)
class Decision:
    """Whether a candidate may come in, and why.

    Attributes
    ----------
    candidate : Candidate
    label : str
    examination : Examination
    accepted : bool
    why : str
        In words.
    gain : float
        Share of the squared residual of its joints that it removes on rows that it was not fitted to.
    """

    candidate: Candidate
    label: str
    examination: Examination
    accepted: bool
    why: str
    gain: float


def decide(candidate: Candidate, examination: Examination, scene: Scene, tried: int) -> Decision:
    """Decide on one candidate.

    Parameters
    ----------
    candidate : Candidate
    examination : Examination
    scene : Scene
    tried : int
        Candidates and scan points tried, for the correction of the p-value.
    """
    joints = scene.robot.n if candidate.member.joint is None else 1
    # The residual is weighted so that every joint holds the same share of its square.
    gain = examination.held_out * scene.robot.n / joints
    why = _objection(candidate, examination, scene, tried, gain)
    words = why or f"removes {gain:.1%} of the squared residual on data that it was not fitted to"
    return Decision(candidate, candidate.label(scene), examination, why is None, words, gain)


def _objection(candidate: Candidate, examination: Examination, scene: Scene, tried: int, gain: float) -> str | None:
    if examination.outside < ABSORBED:
        return "the model absorbs it: these recordings cannot show it"
    if examination.outside < WEAK:
        return f"only {examination.outside:.1e} of it lies outside the model: these recordings cannot show it"
    if examination.p_value * tried > FAMILY_ERROR:
        return f"not significant: p = {examination.p_value:.1e} with {tried} candidates tried"
    std = np.sqrt(np.clip(np.diag(examination.covariance), 0.0, None))
    # Judged beside the parameters that the model has once the candidate is in it.
    after = replace(scene, value=examination.model_value[: len(scene.value)])
    unphysical = candidate.effect.inadmissible(after, candidate.member, examination.value, std)
    if unphysical is not None:
        return unphysical
    # What is corrected in the data is worth correcting however small.
    if not candidate.effect.corrects_data(candidate.member):
        negligible = candidate.effect.negligible(scene, candidate.member, examination.value)
        if negligible is not None:
            return negligible
    if gain < LEAST_GAIN:
        return f"below the detection limit: removes {max(gain, 0.0):.1%} of the squared residual, {LEAST_GAIN:.0%} is asked"
    helps, voting = examination.votes
    if voting and helps < LEAST_VOTES * voting:
        return f"helps in only {helps} of {voting} trajectories that it was not fitted to"
    return None
