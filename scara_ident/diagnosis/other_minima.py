"""Fits begun again from elsewhere: of effects that act together one takes up what another does, and a fit may end in any minimum."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from scara_ident.diagnosis.nonlinear_fit import RISE, linearise, tune
from scara_ident.diagnosis.selection_step import SelectionStep


def lowest(step: SelectionStep) -> SelectionStep:
    """Fit as `tune` does, and where several effects act together from elsewhere too; return the fit with the least error.

    Each of them in turn begins as `Effect.elsewhere` has it, the others where the first fit ended.
    """
    best = tune(step)
    least = _error(best)
    for begun in _elsewhere(best):
        other = tune(begun)
        error = _error(other)
        if error < (1.0 - RISE) * least:
            best, least = other, error
    return best


def _elsewhere(step: SelectionStep) -> Iterator[SelectionStep]:
    """Give a fitted model with one of several effects that act together as it may begin elsewhere."""
    together = [place for place, item in enumerate(step.chosen) if item.effect.together]
    if len(together) < 2:
        return
    for place in together:
        item = step.chosen[place]
        for member in item.effect.elsewhere(step.scene, item.member):
            chosen = (*step.chosen[:place], replace(item, member=member), *step.chosen[place + 1 :])
            yield replace(step, chosen=chosen)


def _error(step: SelectionStep) -> float:
    return linearise(step).error
