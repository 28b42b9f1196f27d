"""Coulomb friction that changes its sign over a range of speeds."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.effect import DOUBT_STDS, Effect
from scara_ident.effects.friction import SLOWEST_STRIBECK, WIDEST_STRIBECK, friction_of
from scara_ident.effects.parameters import Coefficient, Member, NonlinearParameter, View
from scara_ident.effects.signals import Scene, Signals

# Speeds tried, as shares of the joint's largest: four times apart, which refinement bridges.
SPEED_SHARES = (0.01, 0.04, 0.16)
# What changes its sign smoothly is at least this many times what slides, or it is something else; and at most so many times.
SMALLEST_SHARE, LARGEST_SHARE = 0.4, 1.5


class SmoothCoulomb(Effect):
    """Coulomb friction without a jump: ``u = amplitude tanh(v/velocity)`` where the base model has ``a0 sign(v)``.

    The column is ``tanh(v/velocity) - sign(v)`` and its coefficient comes out near a0. It is the sigmoid that is fitted to
    arms whose joints creep through a reversal (Gaz, Cognetti, Oliva, Robuffo Giordano, De Luca 2019, "Dynamic
    identification of the Franka Emika Panda robot"), and what most simulators have.
    """

    name = "smooth_coulomb"
    summary = "Coulomb friction that builds up with speed, without a jump at a reversal"
    coefficients = (
        Coefficient(
            "amplitude", "{torque}", "Coulomb friction of {joint} that builds up with speed",
            "friction would be larger near rest",
        ),
    )  # fmt: skip
    nonlinear = (NonlinearParameter("velocity", "{position}/s", 1e-4, 5.0),)
    of_state = True
    view = View("velocity")
    experiment = "run at eight or more constant speeds, spaced by a constant factor down to creeping"

    def scan(self, scene: Scene, joint: int) -> Iterable[tuple[float, ...]]:
        """Return shares of the joint's largest speed."""
        return ((share * float(scene.speed[joint]),) for share in SPEED_SHARES)

    def limits(self, scene: Scene, member: Member) -> tuple[tuple[float, float], ...]:
        """Return shares of the largest speed of a joint that slides, whose speeds may be those of a stage or of a gantry."""
        if not scene.robot.prismatic[member.place]:
            return super().limits(scene, member)
        speed = float(scene.speed[member.place])
        return ((SLOWEST_STRIBECK * speed, speed),)

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
        wrong = super().inadmissible(scene, member, value, std)
        if wrong is not None:
            return wrong
        if member.nonlinear[0] > WIDEST_STRIBECK * scene.speed[member.place]:
            return "the joint is never fast against this speed"
        coulomb = friction_of(scene, member.place).get(0)
        if coulomb is not None and value[0] + DOUBT_STDS * std[0] < SMALLEST_SHARE * max(coulomb, 0.0):
            return "only a small part of the Coulomb friction would build up with speed; all of it does"
        if coulomb is not None and value[0] - DOUBT_STDS * std[0] > LARGEST_SHARE * max(coulomb, 0.0):
            return f"it would be more than {LARGEST_SHARE:g} times the Coulomb friction"
        return None
