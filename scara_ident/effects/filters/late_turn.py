"""Coulomb friction that turns late, as a narrow filter of the motion makes it seem to, and the rate of a torque."""

from __future__ import annotations

from collections.abc import Iterable

from scara_ident.arrays import Array
from scara_ident.effects.effect import Effect
from scara_ident.effects.parameters import Coefficient, Member
from scara_ident.effects.signals import Signals
from scara_ident.motion.low_pass import derivative


class LateTurn(Effect):
    """Coulomb friction of a joint that jumps later than the filtered velocity turns.

    It is no part of an arm and in no catalogue. Acceleration changes where friction jumps, and a narrow filter, which rounds that off,
    moves the time of the turn, by 1.7 ms in a band of 7 Hz; friction that builds up over a distance is late too. In so narrow a band the
    few rows where friction jumps have most of what the torque's rate has beyond the model, and would tell a delay that no other row has.
    """

    name = "late_turn"
    summary = "friction that changes sign later than the velocity"
    coefficients = (Coefficient("step_delay", "{torque} s", "Coulomb friction of {joint} times its delay"),)
    not_simulated = "it is not a property of the arm"

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return what one unit of Coulomb friction lacks for each second that it is late."""
        return lacking(signals, signals.sign[member.place : member.place + 1])


def lacking(signals: Signals, torque: Array) -> Array:
    """Return what a torque (k, N) lacks for each second that it is late, ``-du/dt``."""
    return -derivative(torque, signals.motion.rate, signals.derivative_cut, 1)
