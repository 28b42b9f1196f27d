"""Effects that these recordings cannot tell apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from scara_ident.diagnosis.acceptance import Decision
from scara_ident.diagnosis.candidate_tests import held_out_gains
from scara_ident.diagnosis.candidates import Candidate
from scara_ident.diagnosis.noise_check import noise_left
from scara_ident.diagnosis.search import fitted_beside
from scara_ident.diagnosis.selection_step import SelectionStep, best_of_each
from scara_ident.diagnosis.variation_check import counted
from scara_ident.effects import Scene

# Columns that follow the base model's estimate instead of the last one gain at least this share of what they would.
LEAST_AT_FIRST = 0.5


@dataclass(frozen=True)
class Confounder:
    """An effect that would do nearly as well as one that was found.

    Attributes
    ----------
    label, effect : str
    joint : str or None
    gain : float
        Of it in the place of the effect found; see `gains`.
    found_gain : float
        Of the effect found.
    candidate : Candidate
    value : tuple of float
        Its coefficients in the place of the effect found.
    """

    label: str
    effect: str
    joint: str | None
    gain: float
    found_gain: float
    candidate: Candidate
    value: tuple[float, ...]


def confounders(
    step: SelectionStep, decisions: Sequence[Decision], first: Scene, doubtful: Sequence[Candidate] = ()
) -> list[tuple[Confounder, ...]]:
    """Return for each chosen effect those that these recordings cannot tell from it.

    Parameters
    ----------
    step : SelectionStep
        The model with the effects that stayed.
    decisions : sequence of Decision
        On the candidates that were tried beside it.
    first : Scene
        Where the columns of all of them are at hand.
    doubtful : sequence of Candidate, optional
        See `Effect.doubtful`.
    """
    pool = [decision.candidate for decision in decisions]
    return [_confounders_of(step.without(k), item, pool, first, doubtful) for k, item in enumerate(step.chosen)]


def _confounders_of(
    step: SelectionStep, found: Candidate, pool: Sequence[Candidate], first: Scene, doubtful: Sequence[Candidate]
) -> tuple[Confounder, ...]:
    # A rival is asked for once, not in every round of a search, and need not be believed itself: how many others were tried
    # says nothing of whether these two can be told apart. One of the whole arm need not remove as much as all joints leave.
    scene, of_one = step.scene, replace(step.criteria, family_error=step.criteria.significant)
    criteria = replace(of_one, least_gain=of_one.least_gain / scene.robot.n)
    step = replace(step, criteria=criteria, tried=1)
    # What a model fits of what runs differ by says nothing for it.
    step = counted(step, step.judge([found])[0])
    own = step.judge([found])[0]
    twins = [Candidate(*twin) for twin in found.effect.same_columns(scene, found.member)]
    # Of all joints together: candidates of different joints are compared. Those that remove too little, most of them, need
    # no test.
    saved = own.examination.held_out
    least = criteria.near_confounder * saved
    enough = list(dict.fromkeys([*pool, *twins, *doubtful]))
    # By the columns at hand first: most come nowhere near, and need no others.
    for columns, asked in ((first, LEAST_AT_FIRST * least), (scene, least)):
        found_gains = held_out_gains(step.model, step.rows(columns, enough), criteria)
        enough = [item for item, gain in zip(enough, found_gains, strict=True) if gain > asked]
    judged = list(best_of_each(step.judge(enough)).values())
    to_fit = [item for item in judged if item.candidate.effect.fitted_first]
    # What is chosen by a fit is compared by one: its grid points lose most of it.
    fitted = fitted_beside(replace(step, criteria=of_one), to_fit, 0.0, None)
    near = [item for item in judged if item.accepted and item.examination.held_out > least]
    # Refined, what is doubtful would do what anything does over so little of it.
    refined = step.refine(
        [item for item in near if not (item.candidate.effect.fitted_first or item.candidate in doubtful)]
    )
    near = [*refined, *(item for item in near if item.candidate in doubtful)]
    others = []
    for beside, decision in [*((step, item) for item in near), *fitted]:
        better = decision.examination.held_out >= saved
        able = better or decision.examination.held_out >= criteria.least_share * saved
        if decision.accepted and able and (better or _same((step, own), (beside, decision))):
            candidate = decision.candidate
            name, joint = candidate.effect.name, candidate.joint(scene)
            value = tuple(float(x) for x in decision.examination.value)
            others.append(Confounder(decision.label, name, joint, decision.gain, own.gain, candidate, value))
    return tuple(sorted(others, key=lambda item: -item.gain))


def _same(own: tuple[SelectionStep, Decision], other: tuple[SelectionStep, Decision]) -> bool:
    """Whether the errors of two models, each a candidate beside a step, differ by no more than chance or noise makes."""
    worse = other[1].examination.left - own[1].examination.left
    difference, least = float(np.sum(worse)), own[0].criteria.alike * float(np.sqrt(len(worse) * np.var(worse)))
    if abs(difference) < least:
        return True
    # The noise of the positions is in the columns of one more than in those of the other.
    grown, own_grown = (noise_left(step, decision.candidate) for step, decision in (other, own))
    return abs(difference - grown + own_grown) < least
