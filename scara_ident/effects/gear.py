"""Losses of the gear that grow with the torque that it transmits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.effects.effect import Knob, Member, Parameter
from scara_ident.effects.signals import Scene, Signals
from scara_ident.terms import Column

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TransmissionLoss:
    """A share of the transmitted torque is lost in the gear, against the motion.

    ``u_loss = c |tau_l| sign(v)`` with the transmitted torque tau_l, which leaves out the own rotor's inertia.
    Hamon, Gautier, Garrec (2011), "New dry friction model with load- and velocity-dependence".
    """

    @property
    def name(self) -> str:
        """Name in the table of effects."""
        return "transmission_loss"

    @property
    def knobs(self) -> tuple[Knob, ...]:
        """It has no nonlinear parameter."""
        return ()

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """One per joint."""
        return tuple(Member(j) for j in range(scene.robot.n))

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """One column: the lost share."""
        joint = scene.robot.joints[member.joint or 0]
        return (Column("loss_coefficient", joint, "1", f"share of the transmitted torque lost in {joint}", True),)

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return ``|tau_l| sign(v)``, shape (n, 1, N)."""
        j = member.joint or 0
        return signals.row(j, [np.abs(signals.load(j)) * signals.sign[j]])

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """A gear takes energy out and passes some on."""
        if value[0] < -2.0 * std[0]:
            return "a gear cannot give energy: the lost share is negative"
        if value[0] > 0.75 + 2.0 * std[0]:
            return "over three quarters of the torque would be lost"
        return None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return the lost share."""
        return {"loss_coefficient": Parameter(float(value[0]), float(np.sqrt(covariance[0, 0])), "1")}

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is."""
        return "gear loss that grows with the transmitted torque"
