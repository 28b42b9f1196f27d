"""Exchange of an effect for one that explains more in its place: early effects were chosen without the later ones."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.checks.same_errors import ROUNDING, same
from scara_ident.diagnosis.fitting.interval_fit import refined
from scara_ident.diagnosis.fitting.nonlinear_fit import tune
from scara_ident.diagnosis.selection.choice import fitted_beside, fitted_with, objection
from scara_ident.diagnosis.selection.of_all_joints import takes_in
from scara_ident.diagnosis.testing.acceptance import Decision
from scara_ident.diagnosis.testing.candidate_tests import held_out_gains
from scara_ident.diagnosis.testing.selection_step import SelectionStep, best_of_each
from scara_ident.effects import Scene

# Columns at the base model's estimate have at least this share of the gain that columns at the last estimate have.
MIN_PRELIMINARY_SHARE = 0.5
# Why an effect that is dropped and would come in again, once the others are fitted without it, is not believed.
DROPPED = "it was found, and beside the others as fitted with it it was no longer accepted"


@dataclass(frozen=True, eq=False)
class Exchange:
    """An effect in the place of another, or of the same on single joints.

    Attributes
    ----------
    places : tuple of int
        Indices of the removed effects, among those chosen.
    decision : Decision
        Decision on the new effect.
    scene : Scene
        The scene for the next step.
    saved : float
        Reduction of the weighted squared residual.
    """

    places: tuple[int, ...]
    decision: Decision
    scene: Scene
    saved: float


def best_exchange(
    step: SelectionStep,
    pool: Sequence[Candidate],
    first: Scene,
    without: Collection[str] = (),
    refused: Collection[str] = (),
) -> Exchange | None:
    """Return the exchange with the largest improvement, or as good with fewer effects, everything else fitted again; None if there is none.

    Parameters
    ----------
    step : SelectionStep
        The model with all accepted effects.
    pool : sequence of Candidate
        All candidates that may replace an effect.
    first : Scene
        Where the columns of the pool are at hand.
    without : collection of str, optional
        Labels of effects that must not be tried.
    refused : collection of str, optional
        Labels of those that have an objection beside the effects chosen.
    """
    found = []
    held = {item.label(step.scene) for item in step.chosen} | {*without, *refused}
    able = [item for item in pool if not item.corrects_data and item.label(step.scene) not in held]
    count = cache(lambda: len(needed(step)))
    for place, item in enumerate(step.chosen):
        beside = step.without(place)
        (own,) = beside.judge([item])
        least = ROUNDING * float(np.sum(beside.model.squares))
        for other, decision in _fitted_alternatives(beside, own, able, first):
            saved = float(np.sum(own.examination.left) - np.sum(decision.examination.left))
            saved = saved if abs(saved) > least else 0.0
            alike = same((beside, own), (other, decision))
            # Of two that explain as much, the one that needs fewer others is the better explanation.
            better = _fewer(count, other, decision) if alike else saved > 0.0
            if better and objection(other, decision) is None:
                found.append(Exchange((place,), decision, other.scene, saved))
    found += _of_all_joints(step, pool, without)
    return max(found, key=lambda each: each.saved, default=None)


def _of_all_joints(step: SelectionStep, pool: Sequence[Candidate], without: Collection[str]) -> list[Exchange]:
    """Return what corrects the data of all joints in the place of the same effect on all single joints that have it.

    Where it explains as much as several of them do, they differ by no more than chance. That beside them it may have been
    refused says nothing of it: it is then asked only what they leave. What each recording has of its own is judged on other
    held-out data, and cannot be compared.
    """
    found = []
    for whole in pool:
        places = tuple(place for place, item in enumerate(step.chosen) if takes_in(whole, item))
        if not places or whole.effect.of_each_recording or whole.label(step.scene) in without:
            continue
        last = step.without(places[-1])
        beside = replace(step, chosen=tuple(item for place, item in enumerate(step.chosen) if place not in places))
        (own,), (decision,) = last.judge([step.chosen[places[-1]]]), beside.judge([whole])
        saved = float(np.sum(own.examination.left) - np.sum(decision.examination.left))
        alike = same((last, own), (beside, decision))
        better = len(places) > 1 if alike else saved > 0.0
        if decision.accepted and better and objection(beside, decision) is None:
            found.append(Exchange(places, decision, beside.scene, saved))
    return found


def needed(step: SelectionStep) -> tuple[Candidate, ...]:
    """Remove, one at a time, effects that the others have made superfluous."""
    while len(step.chosen) > 1:
        decisions = [step.without(k).judge([item])[0] for k, item in enumerate(step.chosen)]
        weakest = min(range(len(decisions)), key=lambda k: decisions[k].gain)
        if decisions[weakest].accepted:
            break
        step = step.without(weakest)
    return step.chosen


def without_superfluous(step: SelectionStep) -> tuple[SelectionStep, list[Decision]]:
    """Return the step with the effects that are still needed, all fitted together, and the decisions on the others beside them.

    Whether an effect is needed is asked with all parameters fitted together: a coarse fit of one effect may hide another.
    """
    fitted = tune(step)
    kept = needed(fitted)
    gone = [item for item in fitted.chosen if item not in kept]
    end = refined(tune(replace(fitted, chosen=kept)) if gone else fitted)
    judged = end.judge(gone) if gone else []
    return end, [item.refused(DROPPED) if item.accepted else item for item in judged]


def near_in_place(step: SelectionStep, found: Decision, pool: Sequence[Candidate], first: Scene) -> list[Decision]:
    """Return the best grid point of each candidate that removes nearly as much in the place of an effect.

    Parameters
    ----------
    step : SelectionStep
        The model without the effect.
    found : Decision
        Decision on the effect with this model.
    first : Scene
        Where the columns of the pool are at hand.
    """
    criteria, effect = step.criteria, found.candidate.effect
    least = criteria.near_confounder * found.examination.held_out

    def enough(candidates: list[Candidate], columns: Scene, asked: float) -> list[Candidate]:
        gained = held_out_gains(step.model, step.rows_at_hand(columns, candidates), criteria)
        return [item for item, gain in zip(candidates, gained, strict=True) if gain > asked]

    # First with the available columns: most candidates are far away and need no new columns. But the effect itself on
    # another joint depends on the model as it does here.
    alike = [item for item in pool if item.effect.name == effect.name]
    others = enough([item for item in pool if item.effect.name != effect.name], first, MIN_PRELIMINARY_SHARE * least)
    return list(best_of_each(step.judge(enough([*alike, *others], step.scene, least))).values())


def _fitted_alternatives(
    beside: SelectionStep, own: Decision, pool: Sequence[Candidate], first: Scene
) -> list[tuple[SelectionStep, Decision]]:
    """Return those that explain nearly as much in the place of an effect after refinement, with everything else fitted again."""
    criteria = beside.criteria
    near = near_in_place(beside, own, pool, first)
    by_fit = fitted_beside(beside, [item for item in near if item.candidate.effect.fitted_first], 0.0, None)
    rest = [item for item in near if item.accepted and not item.candidate.effect.fitted_first]
    rest.sort(key=lambda item: -item.examination.held_out)
    enough = criteria.min_share * own.examination.held_out
    refined = [item for item in beside.refine(rest[: criteria.max_refined]) if item.examination.held_out >= enough]
    fitted = [*by_fit, *(fitted_with(beside, item.candidate) for item in refined)]
    return [pair for pair in fitted if pair[1].accepted]


def _fewer(count: Callable[[], int], other: SelectionStep, decision: Decision) -> bool:
    """Whether fewer effects than a count are needed with a replacement."""
    # With two effects, the other one is needed with a replacement that explains as much.
    return len(other.chosen) > 1 and len(needed(replace(other, chosen=(*other.chosen, decision.candidate)))) < count()
