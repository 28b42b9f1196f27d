"""Whether what no catalogue has, such as a constant force on the tool, does as well as an effect that it is taken for."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.fitting.nonlinear_fit import tune
from scara_ident.diagnosis.testing.acceptance import Decision
from scara_ident.diagnosis.testing.selection_step import SelectionStep, best_of_each


def imitation_objection(step: SelectionStep, decision: Decision) -> str | None:
    """Say so where something else removes as much on folds that it was not fitted to, and beside it little of the effect is left.

    By their gain on folds both are judged alike: there further coefficients are no advantage.

    Parameters
    ----------
    step : SelectionStep
        The model that the effect was tried beside.
    decision : Decision
        That lets it in.
    """
    for other, share in _imitating(step, decision):
        what = other.effect.description(step.scene, other.member)
        return f"{what} explains as much in its place, and with it in the model {max(share, 0.0):.0%} of this effect is left"
    return None


def imitators(step: SelectionStep, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Return what does as well as candidates that it may be taken for, where these are significant: it is there, or is like what is.

    Parameters
    ----------
    step : SelectionStep
        The base model.
    """
    asked, criteria = [item for item in candidates if item.effect.imitated_by], step.criteria
    return [
        other
        for decision in (step.judge(asked) if asked else [])
        # An arm need not be able to have as much of it.
        if decision.examination.p_value * step.tried <= criteria.family_error and decision.gain >= criteria.min_gain
        for other, _ in _imitating(step, decision)
    ]


def _imitating(step: SelectionStep, decision: Decision) -> Iterator[tuple[Candidate, float]]:
    """Give what does as well as an effect, with the share of what this removes that is left beside it, less than is asked."""
    effect, criteria = decision.candidate.effect, step.criteria
    own, value = decision.candidate.member, decision.examination.value
    others = [
        Candidate(other, member)
        for other in effect.imitated_by
        for member in (*other.members(step.scene), other.in_place_of(step.scene, effect, own, value))
        if member is not None
    ]
    for point in best_of_each(step.judge(others) if others else []).values():
        alone = tune(replace(step, chosen=(*step.chosen, point.candidate)))
        (instead,) = alone.without(len(step.chosen)).judge([alone.chosen[-1]])
        if not instead.accepted or instead.examination.held_out < decision.examination.held_out:
            continue
        both = tune(replace(alone, chosen=(*alone.chosen, decision.candidate)))
        gained = np.sum(step.model.squares) - np.sum(decision.examination.left)
        share = float(np.sum(alone.model.squares) - np.sum(both.model.squares)) / float(gained)
        if share < criteria.min_beside_rest:
            yield alone.chosen[-1], share
