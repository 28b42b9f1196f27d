"""The law of each effect in the model, chosen again: when it came in, what was still missing may have hidden by which law it acts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.checks.other_laws import by_other_laws, judged_in_place
from scara_ident.diagnosis.checks.same_errors import same
from scara_ident.diagnosis.selection.choice import objection
from scara_ident.diagnosis.selection.search import Search
from scara_ident.diagnosis.testing.selection_step import SelectionStep


def by_better_law(found: Search, weights: Array) -> Search | None:
    """Return a search with one of its effects by another law, where that explains significantly more; None if none does.

    Parameters
    ----------
    found : Search
    weights : ndarray, shape (n,)
        Of each joint's rows in the last fit.
    """
    step = replace(found.step, weights=weights)
    for place, item in enumerate(step.chosen):
        if item.effect.other_laws() and (better := _better(step, place)) is not None:
            return replace(found, step=replace(better, weights=found.step.weights))
    return None


def _better(step: SelectionStep, place: int) -> SelectionStep | None:
    """Return the model with an effect by the law that leaves least, if that is significantly less than by its own."""
    own = judged_in_place(step, place)
    best, least = None, float(np.sum(own[1].examination.left))
    for again in by_other_laws(step, place):
        its = judged_in_place(again, place)
        left = float(np.sum(its[1].examination.left))
        if left < least and its[1].accepted and not same(own, its) and objection(*its) is None:
            best, least = again, left
    return best
