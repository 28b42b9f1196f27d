"""Torques that depend on where the arm is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.effects.effect import Member, NonlinearParameter, Parameter
from scara_ident.effects.signals import Scene, Signals
from scara_ident.model.terms import Column
from scara_ident.model.terms.friction import Offset

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Spring:
    """A cable or hose that pulls a joint to a rest position: ``u = k (q - q0)``.

    A model with a torque offset has the constant ``-k q0`` already. Then the rest position is that of a joint without
    an offset, and no recording can tell how far that is from the truth: its standard deviation is infinite.
    """

    @property
    def name(self) -> str:
        """Name in the table of effects."""
        return "spring"

    @property
    def nonlinear(self) -> tuple[NonlinearParameter, ...]:
        """It has no nonlinear parameter."""
        return ()

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """One per joint."""
        return tuple(Member(j) for j in range(scene.robot.n))

    def columns(self, scene: Scene, member: Member) -> tuple[Column, ...]:
        """One column of the deflection, and one of the constant where the model has no offset."""
        j = member.joint or 0
        joint, torque = scene.robot.joints[j], scene.robot.torque_unit(j)
        angle = "m" if scene.robot.prismatic[j] else "rad"
        stiffness = Column("stiffness", joint, f"{torque}/{angle}", f"stiffness of a spring on {joint}", True)
        if _offset(scene, j) is not None:
            return (stiffness,)
        return stiffness, Column("preload", joint, torque, f"torque of the spring on {joint} at position zero")

    def regressor(self, signals: Signals, member: Member) -> Array:
        """Return position and, without an offset in the model, one; the drive works in its own direction."""
        j = member.joint or 0
        q = signals.scene.robot.drive_sign[j] * signals.motion.q[j]
        alone = _offset(signals.scene, j) is not None
        return signals.row(j, [q] if alone else [q, np.ones_like(q)])

    def inadmissible(self, scene: Scene, member: Member, value: Array, std: Array) -> str | None:
        """A spring pulls back."""
        return "it would push away from its rest position" if value[0] < -2.0 * std[0] else None

    def parameters(self, scene: Scene, member: Member, value: Array, covariance: Array) -> Mapping[str, Parameter]:
        """Return stiffness and rest position."""
        j = member.joint or 0
        unit = scene.robot.torque_unit(j)
        angle = "m" if scene.robot.prismatic[j] else "rad"
        stiffness, sign = float(value[0]), float(scene.robot.drive_sign[j])
        offset = _offset(scene, j)
        preload = sign * float(value[1] if offset is None else scene.value[offset])
        rest = -preload / stiffness if stiffness else np.nan
        spread = np.inf
        if offset is None and stiffness:
            gradient = np.array([-rest, -sign]) / stiffness
            spread = float(np.sqrt(gradient @ covariance @ gradient))
        return {
            "stiffness": Parameter(stiffness, float(np.sqrt(covariance[0, 0])), f"{unit}/{angle}"),
            "rest_position": Parameter(rest, spread, angle),
        }

    def description(self, scene: Scene, member: Member) -> str:
        """Say what it is."""
        offset = _offset(scene, member.joint or 0)
        told = "" if offset is None else ", whose rest position holds if the joint has no torque offset"
        return f"a spring, such as a cable or hose{told}"


def _offset(scene: Scene, joint: int) -> int | None:
    """Return the place of the joint's torque offset among the model's columns, None without one."""
    start = 0
    for term in scene.model.terms:
        if isinstance(term, Offset):
            return start + joint
        start += len(term.columns)
    return None
