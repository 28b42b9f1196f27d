"""What the parameters of an effect owe to the fit that they are of: another law or minimum may explain as much with others."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from scara_ident.diagnosis.effect_parameters import PhysicalParameters, physical_parameters
from scara_ident.diagnosis.nonlinear_fit import tune
from scara_ident.diagnosis.other_minima import as_good, widened
from scara_ident.diagnosis.same_errors import same
from scara_ident.diagnosis.selection_step import SelectionStep


def parameters_of_laws(step: SelectionStep) -> PhysicalParameters:
    """Return the physical parameters of all chosen effects, as uncertain as it is by which law they are.

    Where another law of an effect explains as much, its parameters by that one are as good: what they differ by is one
    more standard deviation. So it is with other fits of effects that act together, see `as_good`. An effect by another law than
    that of its name has what tells the law among its parameters.
    """
    own = physical_parameters(step)
    effects = list(own.effects)
    for place, item in enumerate(step.chosen):
        effects[place] = {**effects[place], **item.effect.law()}
        for other in _as_good(step, place):
            effects[place] = widened(effects[place], physical_parameters(other).effects[place])
    for other in as_good(step):
        told = physical_parameters(other).effects
        for place, item in enumerate(step.chosen):
            if item.effect.together:
                effects[place] = widened(effects[place], told[place])
    return replace(own, effects=tuple(effects))


def _as_good(step: SelectionStep, place: int) -> Iterator[SelectionStep]:
    """Give the model with one effect by each other law that explains as much as its own, all else fitted with it."""
    item = step.chosen[place]
    for family in item.effect.other_laws():
        chosen = (*step.chosen[:place], replace(item, effect=family), *step.chosen[place + 1 :])
        again = tune(replace(step, chosen=chosen))
        pairs = [(each.without(place), each.chosen[place]) for each in (step, again)]
        (mine, mine_judged), (its, its_judged) = [(beside, beside.judge([one])[0]) for beside, one in pairs]
        if same((mine, mine_judged), (its, its_judged)):
            yield again
