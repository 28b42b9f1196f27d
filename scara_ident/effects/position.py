"""Torques that depend on where the arm is."""

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
class Spring:
    """A cable or hose that pulls a joint to a rest position: ``u = k (q - q0)``; the offset carries ``-k q0``."""

    @property
    def name(self) -> str:
        """Name in the table of effects."""
        return "spring"

    @property
    def knobs(self) -> tuple[Knob, ...]:
        """It has no nonlinear parameter."""
        return ()

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """One per joint."""
        return tuple(Member(j) for j in range(scene.robot.n))

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """Two columns, of the deflection and of the constant."""
        j = member.joint or 0
        joint, torque = scene.robot.joints[j], scene.robot.torque_unit(j)
        angle = "m" if scene.robot.prismatic[j] else "rad"
        return (
            Column("stiffness", joint, f"{torque}/{angle}", f"stiffness of a spring on {joint}", True),
            Column("preload", joint, torque, f"torque of the spring on {joint} at position zero"),
        )

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return position and one, shape (n, 2, N); the drive works against the spring in its own direction."""
        j = member.joint or 0
        q = signals.scene.robot.drive_sign[j] * signals.motion.q[j]
        return signals.row(j, [q, np.ones_like(q)])

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """A spring pulls back."""
        return "it would push away from its rest position" if value[0] < -2.0 * std[0] else None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return stiffness and rest position."""
        j = member.joint or 0
        unit = scene.robot.torque_unit(j)
        angle = "m" if scene.robot.prismatic[j] else "rad"
        stiffness, preload = float(value[0]), float(scene.robot.drive_sign[j] * value[1])
        rest = -preload / stiffness if stiffness else np.nan
        gradient = np.array([-rest, -scene.robot.drive_sign[j]]) / stiffness if stiffness else np.zeros(2)
        return {
            "stiffness": Parameter(stiffness, float(np.sqrt(covariance[0, 0])), f"{unit}/{angle}"),
            "rest_position": Parameter(rest, float(np.sqrt(gradient @ covariance @ gradient)), angle),
        }

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is."""
        return "a spring, such as a cable or hose"
