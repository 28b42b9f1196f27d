"""How far the parameters of an effect depend on the fit: another law or another minimum may explain as much with other values.

What is left of a correction of the data may explain more.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import chain

import numpy as np
from numpy.typing import NDArray

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.checks.instants import with_instants_of_each
from scara_ident.diagnosis.checks.other_minima import as_good, widened
from scara_ident.diagnosis.checks.same_errors import same
from scara_ident.diagnosis.fitting.effect_parameters import LinearParameters, PhysicalParameters, physical_parameters
from scara_ident.diagnosis.fitting.nonlinear_fit import tune
from scara_ident.diagnosis.testing.acceptance import Decision
from scara_ident.diagnosis.testing.selection_step import SelectionStep


def parameters_of_laws(step: SelectionStep) -> PhysicalParameters:
    """Return the physical parameters of all chosen effects, as uncertain as it is by which law they are.

    Where another law of an effect explains as much, its parameters by that one are as good: what they differ by is one
    more standard deviation, and so it is of all parameters beside it. So it is with other fits of effects that act together,
    see `as_good`, and with what may be left of a correction of the data in the model. An effect by another law than that of its name has what tells the law among its parameters.
    """
    own = physical_parameters(step)
    effects, linear = list(own.effects), own.linear
    assert linear is not None
    for place, item in enumerate(step.chosen):
        effects[place] = {**effects[place], **item.effect.law()}
        for other in _as_good(step, place):
            elsewhere = physical_parameters(other)
            effects = [widened(each, its) for each, its in zip(effects, elsewhere.effects, strict=True)]
            linear = _apart(linear, elsewhere, np.arange(len(linear.value)))
    for other in chain(as_good(step), _beside_rest(step)):
        elsewhere = physical_parameters(other)
        # What other rows say of the base model is less, and no other fit of these.
        same_rows = other.columns is step.columns
        for place, item in enumerate(step.chosen):
            if same_rows or item.effect.together:
                effects[place] = widened(effects[place], elsewhere.effects[place])
        linear = _apart(linear, elsewhere, np.arange(len(linear.value)) if same_rows else _places(step, own))
    effects = [with_instants_of_each(step, place, elsewhere) for place, elsewhere in enumerate(effects)]
    return replace(own, effects=tuple(effects), linear=linear)


def _apart(own: LinearParameters, other: PhysicalParameters, places: NDArray[np.intp]) -> LinearParameters:
    """Return linear parameters for which what some of them differ by in a fit as good is one more standard deviation.

    Parameters
    ----------
    own : LinearParameters
        Before any was widened, or after.
    other : PhysicalParameters
        Of the same parameters, and perhaps more after them.
    places : ndarray of int
    """
    assert other.linear is not None
    change = np.zeros(len(own.value))
    change[places] = other.linear.value[places] - own.value[places]
    return replace(own, covariance=own.covariance + np.outer(change, change))


def _places(step: SelectionStep, own: PhysicalParameters) -> NDArray[np.intp]:
    """Return the places of the coefficients of effects that act together."""
    sizes = [len(item.value) for item in own.coefficients]
    stops = step.observations.parameters + np.cumsum(sizes)
    ranges = [
        np.arange(stop - size, stop)
        for item, size, stop in zip(step.chosen, sizes, stops, strict=True)
        if item.effect.together
    ]
    return np.concatenate(ranges)


def _beside_rest(step: SelectionStep) -> Iterator[SelectionStep]:
    """Give the model with what may be left of a correction, or what imitates that; neither is a property of the arm."""
    rests = [item for item in step.chosen if item.effect.after_correction]
    imitations = [Candidate(*one) for item in rests for one in item.effect.distinguished_from(step.scene, item.member)]
    beside = (imitations, [] if step.rest is None else [step.rest])
    yield from (tune(replace(step, chosen=(*step.chosen, *added))) for added in beside if added)


def _as_good(step: SelectionStep, place: int) -> Iterator[SelectionStep]:
    """Give the model with one effect by each other law that explains as much as its own, all else fitted with it."""
    own = judged_in_place(step, place)
    for again in by_other_laws(step, place):
        if same(own, judged_in_place(again, place)):
            yield again


def by_other_laws(step: SelectionStep, place: int) -> Iterator[SelectionStep]:
    """Give the model with one effect by each of its other laws, all else fitted with it.

    Parameters
    ----------
    step : SelectionStep
    place : int
        Index of the effect, among those chosen.
    """
    item = step.chosen[place]
    for law in item.effect.other_laws():
        chosen = (*step.chosen[:place], replace(item, effect=law), *step.chosen[place + 1 :])
        yield tune(replace(step, chosen=chosen))


def judged_in_place(step: SelectionStep, place: int) -> tuple[SelectionStep, Decision]:
    """Return the model without one of its effects, and the decision on that effect beside it."""
    beside = step.without(place)
    return beside, beside.judge([step.chosen[place]])[0]
