"""Losses of the gear that grow with the torque that it transmits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.effects.effect import Member, NonlinearParameter, Parameter
from scara_ident.effects.signals import Scene, Signals
from scara_ident.model.terms import Column

Array = NDArray[np.float64]

# A gear that loses more of the torque is broken.
MOST_LOST = 0.75


@dataclass(frozen=True)
class TransmissionLoss:
    """A share of the transmitted torque is lost in the gear, against the motion.

    With the efficiency eta the motor sees tau_l / eta when it drives and tau_l eta when it is driven, which is
    ``sqrt(1 + c^2) tau_l + c |tau_l| sign(v)`` with ``eta = sqrt(1 + c^2) - c`` and the transmitted torque tau_l, which
    leaves out the own rotor's inertia. The first term is of second order; its c is a nonlinear parameter that meets
    the coefficient when it is refined, so that no gain of this joint's torque is left over.
    Hamon, Gautier, Garrec (2011), "New dry friction model with load- and velocity-dependence".
    """

    @property
    def name(self) -> str:
        """Name in the table of effects."""
        return "transmission_loss"

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """The lost share as the second-order term has it; it is not reported beside the coefficient."""
        return (NonlinearParameter("_lost_share", "1", 0.005, MOST_LOST),)

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Three per joint."""
        return tuple(Member(j, (share,)) for j in range(scene.robot.n) for share in (0.05, 0.15, 0.4))

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """One column: the lost share."""
        joint = scene.robot.joints[member.joint or 0]
        return (Column("loss_coefficient", joint, "1", f"share of the transmitted torque lost in {joint}", True),)

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return ``|tau_l| sign(v)`` with its share of the second-order term, shape (n, 1, N)."""
        j, share = member.joint or 0, member.nonlinear[0]
        load = signals.load(j)
        return signals.row(j, [np.abs(load) * signals.sign[j] + (np.sqrt(1.0 + share**2) - 1.0) / share * load])

    def geared_joint(self, member: Member) -> int:
        """Return the joint whose gear it is."""
        return member.joint or 0

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """A gear takes energy out and passes some on."""
        if value[0] < -2.0 * std[0]:
            return "a gear cannot give energy: the lost share is negative"
        if value[0] > MOST_LOST + 2.0 * std[0]:
            return "over three quarters of the torque would be lost"
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the lost share."""
        return {"loss_coefficient": Parameter(float(value[0]), float(np.sqrt(covariance[0, 0])), "1")}

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is."""
        return "gear loss that grows with the transmitted torque"
