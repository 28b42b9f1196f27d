"""Whether what may be left of a correction of the data makes an effect rather than the arm."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.diagnosis.acceptance import Decision
from scara_ident.diagnosis.selection_step import SelectionStep


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
    if step.rest is None or decision.candidate.corrects_data:
        return None
    own, rest = step.judge([decision.candidate, step.rest])
    beside = replace(step, chosen=(*step.chosen, step.rest))
    (again,) = beside.judge([decision.candidate])
    left = again.examination.held_out * float(np.sum(beside.model.squares))
    share = left / (own.examination.held_out * float(np.sum(step.model.squares)))
    # What has nothing to do with it removes as much with it as without.
    if share >= step.criteria.least_beside_rest:
        return None
    what = step.rest.effect.description(step.scene, step.rest.member)
    if rest.examination.held_out >= step.criteria.least_share * own.examination.held_out:
        return f"{what} does as well in its place, and beside it {max(share, 0.0):.0%} of this is left"
    return None if again.accepted else f"beside {what} {max(share, 0.0):.0%} of this is left: {again.why}"
