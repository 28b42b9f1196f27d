"""Coulomb friction that changes its sign over a range of speeds."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.friction import AtLowSpeed, not_all_of_coulomb
from scara_ident.effects.parameters import Coefficient, Member
from scara_ident.effects.signals import Scene, Signals

# Speeds tried, as shares of the joint's largest: four times apart, which refinement bridges.
SPEED_SHARES = (0.01, 0.04, 0.16)
# What changes its sign smoothly is at least this many times what slides, or it is something else; and at most so many times.
SMALLEST_SHARE, LARGEST_SHARE = 0.4, 1.5


class SmoothCoulomb(AtLowSpeed):
    """Coulomb friction without a jump: ``u = amplitude tanh(v/velocity)`` where the base model has ``a0 sign(v)``.

    The column is ``tanh(v/velocity) - sign(v)`` and its coefficient is close to a0. This sigmoid is fitted to arms
    whose joints reverse slowly (Gaz, Cognetti, Oliva, Robuffo Giordano, De Luca 2019, "Dynamic
    identification of the Franka Emika Panda robot"), and most simulators use it.
    """

    name = "smooth_coulomb"
    summary = "Coulomb friction that builds up with speed, without a jump at a reversal"
    coefficients = (
        Coefficient(
            "amplitude", "{torque}", "Coulomb friction of {joint} that builds up with speed",
            "friction would be larger at low speed",
        ),
    )  # fmt: skip
    shares = SPEED_SHARES

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return ``tanh(v/velocity) - sign(v)`` in the drive's direction."""
        j = member.place
        drive = signals.scene.robot.drive_sign[j] * signals.motion.v[j]
        return [np.tanh(drive / member.nonlinear[0]) - signals.sign[j]]

    def turns_on(self, member: Member) -> tuple[float, float]:
        """Return the velocity: of slower joints it must be known which way they go."""
        return np.inf, member.nonlinear[0]

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """Say so where what builds up is not what then slides, or the joint is never fast against its speed."""
        return super().inadmissible(scene, member, value, std) or not_all_of_coulomb(
            scene, member.place, value, std, "with speed", SMALLEST_SHARE, LARGEST_SHARE
        )
