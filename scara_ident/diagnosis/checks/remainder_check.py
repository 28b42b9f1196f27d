"""Whether what a correction leaves in the data produces an effect rather than the arm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.diagnosis.fitting.nonlinear_fit import tune
from scara_ident.diagnosis.testing.acceptance import Decision
from scara_ident.diagnosis.testing.selection_step import SelectionStep

# Of the band that a correction leaves: beyond so many of it a mean over twice the delay leaves less than a tenth of the motion, a lag
# of first order less than a third, and what a recording lacks at single frequencies looks as if something swung there.
HIDDEN = 3.0


def remainder_objection(step: SelectionStep, decision: Decision) -> str | None:
    """Say so where what may be left of a correction leaves an effect little beside it, and does as well in its place or takes what is sure of it.

    What is corrected to first order, as a delay for a filter, leaves a rest: effects of single joints may stand for it, each
    for its own. This is so where the rest is not in the model, and where it is but the effect takes its place there.

    Parameters
    ----------
    step : SelectionStep
        The model that the effect was tried beside.
    decision : Decision
        That lets it in.
    """
    found = [item for item in step.chosen if item.effect.after_correction]
    left = step.rest if step.rest is not None else next(iter(found), None)
    if left in (None, decision.candidate) or decision.candidate.corrects_data:
        return None
    what = left.effect.description(step.scene, left.member)
    seen = decision.candidate.effect.band(decision.candidate.member)
    if seen > HIDDEN * step.left_band:
        return f"it shows in a band of {seen:.3g} Hz, and above {HIDDEN * step.left_band:.3g} Hz these recordings may hold too little: {what}"
    bare = replace(step, chosen=tuple(item for item in step.chosen if item != left))
    # Others in the model were fitted with the effect: what they took up of the rest shows once they are fitted without it, or with that.
    without, rest = tune(bare), tune(replace(bare, chosen=(*bare.chosen, left)))
    both = tune(replace(rest, chosen=(*rest.chosen, decision.candidate)))
    alone = decision.examination.left
    if found:
        alone = tune(replace(bare, chosen=(*bare.chosen, decision.candidate))).model.squares
    before, own, beside = (float(np.sum(each)) for each in (without.model.squares, alone, rest.model.squares))
    share = (beside - float(np.sum(both.model.squares))) / (before - own) if own < before else 0.0
    instead, kept = before - beside >= step.criteria.min_share * (before - own), share >= step.criteria.min_beside_rest
    # What has nothing to do with it removes as much with it as without; where it would do alone, what is left has to be sure beside it.
    if kept and not instead:
        return None
    if instead and not kept:
        return f"{what} explains as much in its place, and with it in the model {max(share, 0.0):.0%} of this effect is left"
    (again,) = both.without(len(rest.chosen)).judge(both.chosen[-1:])
    return (
        None
        if again.accepted
        else f"with {what} in the model, {max(share, 0.0):.0%} of this effect is left: {again.why}"
    )
