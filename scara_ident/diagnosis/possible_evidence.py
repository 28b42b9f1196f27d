"""Whether masses, inertias and rotors are no less than nothing: one that is stands for something that the model lacks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scara_ident.diagnosis.evidence.evidence import Evidence
from scara_ident.diagnosis.found_effect import FoundEffect
from scara_ident.estimation import Estimate
from scara_ident.estimation.pushing import BEYOND_CHANCE
from scara_ident.model.terms import Column


def possible_evidence(
    shown: Sequence[Evidence], after: Estimate, effects: Sequence[FoundEffect]
) -> tuple[Evidence, ...]:
    """Say that something is missing on joints of which a sum of masses, inertias or rotors lies below zero by more than chance.

    Parameters take up a cause that goes as they do, and leave noise: a force that always pulls a sliding joint down is weight,
    and the inertia that this weight has not got is taken off the rotor. A joint on which an effect was found is not asked: a
    body may be in both.

    Parameters
    ----------
    shown : sequence of Evidence
        By joint.
    after : Estimate
        Of the model with the effects found, not held to what an arm can have.
    effects : sequence of FoundEffect
        That were found.
    """
    of_effects, found = {effect.joint for effect in effects}, []
    for item in shown:
        worst = _worst(after, item.joint)
        if worst is not None and not item.lacks and item.joint not in of_effects:
            column, value, std = worst
            why = (
                f"{column.name} ({column.meaning}) would be {value:.3g} ± {std:.1g} {column.unit}, which no body or "
                f"rotor can have: it contains something that the model lacks, or the robot description is wrong"
            )
            item = replace(item, shown=False, by="", why=why, lacks=True)
        found.append(item)
    return tuple(found)


def _worst(after: Estimate, joint: str) -> tuple[Column, float, float] | None:
    """Return the parameter of a joint that is surest below zero though it cannot be, its value and standard deviation."""
    model = after.model
    place = model.place(model.rigid_body)
    below = [
        (column, float(value), float(std))
        for column, value, std in zip(model.rigid_body.columns, after.value[place], after.std[place], strict=True)
        if column.nonnegative and column.joint == joint and value < -BEYOND_CHANCE * std < 0.0 and np.isfinite(std)
    ]
    return min(below, key=lambda item: item[1] / item[2], default=None)
