"""Torque of magnets that pull a joint to some of its positions, whichever way it turns."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from scara_ident.effects import Coefficient, Effect, Member, NonlinearParameter, Signals, View


class Cogging(Effect):
    """A wave over the position of a joint, with so many periods per turn."""

    name = "cogging"
    summary = "magnets pull {joint} to {periods:.3g} positions per turn"
    coefficients = (
        Coefficient("sine", "{torque}", "cogging of {joint}, sine"),
        Coefficient("cosine", "{torque}", "cogging of {joint}, cosine"),
    )
    nonlinear = (NonlinearParameter("periods", "1/turn", 3.0, 12.0),)
    view = View("position")
    experiment = "creep over the whole range, both ways"

    def scan(self, scene, joint: int) -> Iterable[tuple[float, ...]]:
        """Return the numbers of periods to try."""
        return ((float(periods),) for periods in range(4, 9))

    def signal_columns(self, signals: Signals, member: Member) -> list[Any]:
        """Return sine and cosine."""
        angle = member.nonlinear[0] * signals.motion.q[member.place]
        return [np.sin(angle), np.cos(angle)]
