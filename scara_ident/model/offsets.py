"""The place of each joint's constant torque in a model."""

from __future__ import annotations

from scara_ident.model.model import TorqueModel
from scara_ident.model.terms.friction import Offset

# Runs are given offsets of their own where these leave no more than this share of the squared residual: they make most of it.
OWN_LEAVE = 0.5


def offset_columns(model: TorqueModel) -> tuple[int | None, ...]:
    """Return the column of each joint's offset; None of a joint without one."""
    places = [model.place(term) for term in model.terms if isinstance(term, Offset)]
    return tuple(
        next((int(column) for column in own if any(place.start <= column < place.stop for place in places)), None)
        for own in model.active
    )
