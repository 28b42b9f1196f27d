"""How the effects found moved the model's own parameters, and whether away from the URDF's values."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from scara_ident.diagnosis.diagnose import Diagnosis
from scara_ident.manners import listed
from scara_ident.model.urdf_values import urdf_values

# A parameter moved if it changed by more than so many standard deviations.
MIN_STDS = 3.0
# It moved away from the URDF's value if it is then so many times farther from it, by so many standard deviations, and by such a
# share of the largest value that the URDF has of its unit: small links are often wrong in a URDF.
AWAY_RATIO, AWAY_STDS, AWAY_SHARE = 1.5, 5.0, 0.2
# Parameters that the sentence names.
MAX_NAMED = 3


def moved(diagnosis: Diagnosis) -> list[dict[str, Any]]:
    """Return the parameters of the base model that moved by over three standard deviations."""
    before, after, found = diagnosis.before, diagnosis.after, []
    for k, (column, stated) in enumerate(zip(before.model.columns, urdf_values(before.model), strict=True)):
        change = float(after.value[k] - before.value[k])
        std = float(after.std[k])
        if diagnosis.effects and std > 0.0 and abs(change) > MIN_STDS * std:
            found.append(
                {"name": column.name, "urdf": stated, "before": before.value[k], "after": after.value[k]}
                | {"in_std": change / std}
            )
    return sorted(found, key=lambda item: -abs(item["in_std"]))


def away_from_urdf(diagnosis: Diagnosis) -> str | None:
    """Say which bodies the effects moved away from the URDF, as one does that stands for another; None where they moved none.

    An effect that is missing biases the bodies, so with the right one they come nearer to what was drawn. One that explains the
    torque of another, as nearly straight lines explain a piece of a curve, takes from the bodies what it has too much.
    """
    model = diagnosis.before.model
    stated = urdf_values(model)
    units = [column.unit for column in model.columns]
    known = np.isfinite(stated)
    largest = {
        unit: max(abs(value) for value, other, own in zip(stated, units, known, strict=True) if own and other == unit)
        for unit in {unit for unit, own in zip(units, known, strict=True) if own}
    }
    unit_of = dict(zip(model.names, units, strict=True))
    away = [item for item in moved(diagnosis) if _is_away(item, largest.get(unit_of[item["name"]], np.inf))]
    if not away:
        return None
    named = [
        f"{item['name']} from {item['before']:.3g} to {item['after']:.3g} {unit_of[item['name']]} (URDF {item['urdf']:.3g})"
        for item in away
    ]
    return (
        f"With what was found, bodies moved away from the URDF: {listed(named, MAX_NAMED)}. If the URDF is about right there, "
        "something else acts that these motions hardly distinguish from what was found: repeat with a wider range."
    )


def _is_away(item: Mapping[str, Any], largest: float) -> bool:
    before, after = abs(item["before"] - item["urdf"]), abs(item["after"] - item["urdf"])
    return bool(
        after > AWAY_RATIO * before and abs(item["in_std"]) > AWAY_STDS and after - before > AWAY_SHARE * largest
    )
