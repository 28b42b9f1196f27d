"""A last look at the effects found, each beside all others: those that do not stand it are not believed."""

from __future__ import annotations

from dataclasses import replace

from scara_ident.arrays import Array
from scara_ident.diagnosis.acceptance import Decision
from scara_ident.diagnosis.candidates import Candidate
from scara_ident.diagnosis.effect_parameters import physical_parameters
from scara_ident.diagnosis.noise_check import noise_objection
from scara_ident.diagnosis.search import Search
from scara_ident.diagnosis.variation_check import variation_objection
from scara_ident.effects import Parameter


def unsettled(found: Search, weights: Array) -> list[Decision]:
    """Return the decisions on effects in the model that do not stand beside the others, with why.

    When an effect came in, others that came later were still missing, whose torque it may have stood for.

    Parameters
    ----------
    found : Search
    weights : ndarray, shape (n,)
        Of each joint's rows in the last fit.
    """
    step = replace(found.step, weights=weights)
    if not step.chosen:
        return []
    # Whether runs that differ make it is asked of it alone, on rows that weigh them as noise.
    parameters = physical_parameters(step, runs_differ=False).effects
    result = []
    for place, (candidate, values) in enumerate(zip(step.chosen, parameters, strict=True)):
        beside = step.without(place)
        (decision,) = beside.judge([candidate])
        why = None if decision.accepted else decision.why
        why = why or uncertain(candidate, values, step.criteria.least_size)
        why = why or noise_objection(beside, decision) or variation_objection(beside, decision)
        if why is not None:
            result.append(decision.refused(why))
    return result


def uncertain(candidate: Candidate, values: dict[str, Parameter], least_size: float) -> str | None:
    """Say so where no size of an effect is beyond its uncertainty with everything free.

    Parameters
    ----------
    candidate : Candidate
    values : dict of str to Parameter
        Its physical parameters.
    least_size : float
        Standard deviations that a size must have.
    """
    shape = {parameter.name for parameter in candidate.effect.nonlinear} | {"phase"}
    sizes = {name: item for name, item in values.items() if name not in shape}
    if any(abs(item.value) > least_size * item.std for item in sizes.values()):
        return None
    name, item = max(sizes.items(), key=lambda pair: abs(pair[1].value) / max(pair[1].std, 1e-300))
    return f"its {name} of {item.value:.2g} is uncertain by {item.std:.1g} beside all that was found"
