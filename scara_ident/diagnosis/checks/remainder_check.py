"""Whether what a correction leaves in the data produces an effect rather than the arm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.diagnosis.fitting.nonlinear_fit import tune
from scara_ident.diagnosis.testing.acceptance import Decision
from scara_ident.diagnosis.testing.selection_step import SelectionStep


def remainder_objection(step: SelectionStep, decision: Decision) -> str | None:
    """Say so where what may be left of a correction leaves an effect little beside it, and does as well in its place or takes what is sure of it.

    What is corrected to first order, as a delay for a filter, leaves a rest that is no part of an arm and is not listed: effects
    of single joints may stand for it, each for its own.

    Parameters
    ----------
    step : SelectionStep
        The model that the effect was tried beside.
    decision : Decision
        That lets it in.
    """
    if step.rest in (None, decision.candidate) or decision.candidate.corrects_data:
        return None
    # Others in the model were fitted with the effect: what they took up of the rest shows once they are fitted without it, or with that.
    without = tune(step)
    rest = tune(replace(step, chosen=(*step.chosen, step.rest)))
    both = tune(replace(rest, chosen=(*rest.chosen, decision.candidate)))
    before, own, left = (
        float(np.sum(each)) for each in (without.model.squares, decision.examination.left, rest.model.squares)
    )
    share = (left - float(np.sum(both.model.squares))) / (before - own) if own < before else 0.0
    instead, kept = before - left >= step.criteria.min_share * (before - own), share >= step.criteria.min_beside_rest
    # What has nothing to do with it removes as much with it as without; where it would do alone, what is left has to be sure beside it.
    if kept and not instead:
        return None
    what = step.rest.effect.description(step.scene, step.rest.member)
    if instead and not kept:
        return f"{what} explains as much in its place, and with it in the model {max(share, 0.0):.0%} of this effect is left"
    (again,) = both.without(len(rest.chosen)).judge(both.chosen[-1:])
    return (
        None
        if again.accepted
        else f"with {what} in the model, {max(share, 0.0):.0%} of this effect is left: {again.why}"
    )
