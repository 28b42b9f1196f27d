"""Torques that depend on position or time alone: ripple and vibration of the drive, a spring on the link."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.effects.effect import BY_ARM, Effect, Vector
from scara_ident.simulation.plant import PlantDraft


@dataclass(frozen=True)
class TorqueRipple(Effect):
    """A torque periodic in the motor's angle: ``amplitude sin(order N q + phase)``.

    It acts in the drive, so that at speed, where the controller cannot follow, it shows in the motion and not in the
    recorded torque. With ``sensor`` only the torque measurement has it. May be given several times.
    """

    name: ClassVar[str] = "torque_ripple"
    units: ClassVar[dict[str, str]] = {"order": "1 / motor turn", "amplitude": "N m", "phase": "rad"}
    bounds: ClassVar[dict[str, tuple[float, float]]] = {"order": (0.0, np.inf), "amplitude": (0.0, np.inf)}
    shares: ClassVar[dict[str, float]] = {"amplitude": 0.06}
    order: float = 2.0
    amplitude: float = BY_ARM
    phase: float = 0.7
    sensor: bool = False

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Append a row."""
        j = self.place(arm)
        order = self.order * draft.reduction[j]
        if self.sensor:
            draft.pickup.append((j, order, self.amplitude, self.phase))
        else:
            draft.append("ripple", j, order, draft.scale[j] * self.amplitude, self.phase)


@dataclass(frozen=True)
class Spring(Effect):
    """A spring that pulls the link, such as a cable: ``stiffness (q - rest_position)``, which goes through the gear."""

    name: ClassVar[str] = "spring"
    units: ClassVar[dict[str, str]] = {"stiffness": "N m/rad", "rest_position": "rad"}
    ways: ClassVar[dict[str, float]] = {"rest_position": 0.3}
    arrays: ClassVar[dict[str, str]] = {"stiffness": "spring", "rest_position": "spring_rest"}
    joint_side = ("stiffness",)
    stiffness: float = BY_ARM
    rest_position: float = BY_ARM

    def sizes(self, arm: VirtualArm, joint: int) -> Mapping[str, float | Vector]:
        """Give a share of the usual torque over a radian, or over as much of a slide's stroke."""
        return {**super().sizes(arm, joint), "stiffness": float(0.1 * arm.torque_scale[joint] / arm.radian[joint])}


@dataclass(frozen=True)
class Vibration(Effect):
    """A torque periodic in time, whatever the arm does: ``amplitude sin(2 pi frequency t + phase)``.

    It acts in the drive. May be given several times.
    """

    name: ClassVar[str] = "vibration"
    units: ClassVar[dict[str, str]] = {"frequency": "Hz", "amplitude": "N m", "phase": "rad"}
    bounds: ClassVar[dict[str, tuple[float, float]]] = {"frequency": (0.0, np.inf), "amplitude": (0.0, np.inf)}
    shares: ClassVar[dict[str, float]] = {"amplitude": 0.05}
    frequency: float = 6.0
    amplitude: float = BY_ARM
    phase: float = 0.4

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Append a row."""
        j = self.place(arm)
        draft.append("vibration", j, self.frequency, draft.scale[j] * self.amplitude, self.phase)
