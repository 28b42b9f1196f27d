"""The gear between motor and link: its loss, its elasticity, its clearance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from scara_ident.errors import UsageError
from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.effects.effect import BY_ARM, Effect, Vector, vacant
from scara_ident.simulation.plant import PlantDraft


@dataclass(frozen=True)
class TransmissionLoss(Effect):
    """A gear with the same efficiency eta in both directions of power flow.

    With the torque ``tau_l`` that goes through the gear to the link, without the rotor's own inertia, the motor gives
    ``tau_l / (N eta)`` where it drives (tau_l v > 0) and ``tau_l eta / N`` where it is driven. Of the transmitted
    torque the shares 1/eta - 1 and 1 - eta are lost; their mean is the loss coefficient, so that with
    ``eta = sqrt(1 + c^2) - c``

        u_l = tau_l/N sqrt(1 + c^2) + c |tau_l/N| sign(v)

    exactly, and a column ``|tau_l/N| sign(v)`` finds c. At standstill the gear holds within the same bounds.
    """

    name: ClassVar[str] = "transmission_loss"
    units: ClassVar[dict[str, str]] = {"loss_coefficient": "1"}
    bounds: ClassVar[dict[str, tuple[float, float]]] = {"loss_coefficient": (0.0, 5.0)}
    loss_coefficient: float = 0.15

    @property
    def efficiency(self) -> float:
        """Share of the torque put in that comes out, in either direction."""
        return float(np.hypot(1.0, self.loss_coefficient) - self.loss_coefficient)

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Set the efficiency."""
        j = self.place(arm)
        vacant(self, draft.arrays["efficiency"][j], 1.0)
        draft.arrays["efficiency"][j] = self.efficiency

    def as_dict(self) -> dict[str, Any]:
        """Add the efficiency."""
        return super().as_dict() | {"efficiency": self.efficiency}


def _needs_rotor(effect: Effect, draft: PlantDraft, j: int) -> None:
    if draft.arrays["armature"][j] <= 0.0:
        raise UsageError(f"{effect.name}: {effect.joint} has no rotor inertia; an elastic joint needs one on its motor")


@dataclass(frozen=True)
class JointElasticity(Effect):
    """An elastic joint: motor and link have their own positions and speeds, the encoder is on the motor.

    ``tau_l = stiffness (theta - q) + damping (theta' - q')`` at the joint; the motor moves the rotor and carries the
    friction. ``damping_ratio`` is that of the motor against the joint's own link, both free.
    """

    name: ClassVar[str] = "joint_elasticity"
    units: ClassVar[dict[str, str]] = {"stiffness": "N m/rad", "damping_ratio": "1"}
    bounds: ClassVar[dict[str, tuple[float, float]]] = {"stiffness": (1e-6, np.inf), "damping_ratio": (0.0, 5.0)}
    stiffness: float = BY_ARM
    damping_ratio: float = 0.03

    def sizes(self, arm: VirtualArm, joint: int) -> dict[str, float]:
        """Give a resonance of 25 Hz between motor and link."""
        return {"stiffness": float((2 * np.pi * 25.0) ** 2 * _reduced_inertia(arm, joint))}

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Give the joint its own link coordinate."""
        j = self.place(arm)
        _needs_rotor(self, draft, j)
        vacant(self, 0.0 if draft.arrays["width"][j] else draft.arrays["elastic"][j])
        reduced = _reduced_inertia(arm, arm.robot.joint_index(self.joint or arm.robot.joints[0]))
        draft.arrays["elastic"][j] = 1.0
        draft.arrays["stiffness"][j] = self.stiffness
        draft.arrays["damping"][j] = 2.0 * self.damping_ratio * np.sqrt(self.stiffness * reduced)


@dataclass(frozen=True)
class Backlash(Effect):
    """Clearance between motor and link, closed by an elastic contact.

    ``width`` is the whole way from one flank to the other, at the joint. Contact stiffness and damping are those of
    `JointElasticity` where the joint has both, else those given here. A contact cannot pull.
    """

    name: ClassVar[str] = "backlash"
    units: ClassVar[dict[str, str]] = {"width": "rad", "contact_stiffness": "N m/rad", "contact_damping_ratio": "1"}
    ways: ClassVar[dict[str, float]] = {"width": 0.001}
    bounds: ClassVar[dict[str, tuple[float, float]]] = {
        "width": (0.0, np.inf),
        "contact_stiffness": (1e-6, np.inf),
        "contact_damping_ratio": (0.0, 5.0),
    }
    width: float = BY_ARM
    contact_stiffness: float = BY_ARM
    contact_damping_ratio: float = 0.3

    def sizes(self, arm: VirtualArm, joint: int) -> Mapping[str, float | Vector]:
        """Give a contact resonance of 80 Hz."""
        stiffness = float((2 * np.pi * 80.0) ** 2 * _reduced_inertia(arm, joint))
        return {**super().sizes(arm, joint), "contact_stiffness": stiffness}

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Open the clearance."""
        if self.width == 0.0:
            return
        j = self.place(arm)
        _needs_rotor(self, draft, j)
        vacant(self, draft.arrays["width"][j])
        draft.arrays["width"][j] = self.width
        if not draft.arrays["elastic"][j]:
            reduced = _reduced_inertia(arm, arm.robot.joint_index(self.joint or arm.robot.joints[0]))
            draft.arrays["elastic"][j] = 1.0
            draft.arrays["stiffness"][j] = self.contact_stiffness
            draft.arrays["damping"][j] = 2.0 * self.contact_damping_ratio * np.sqrt(self.contact_stiffness * reduced)


def _reduced_inertia(arm: VirtualArm, joint: int) -> float:
    """Reduced mass of rotor and link about a joint, 1/(1/Jr + 1/Jl), the link's at the neutral pose, kg m^2."""
    link, rotor = float(arm.link_inertia()[joint]), float(arm.armature[joint])
    return link * rotor / (link + rotor) if rotor > 0.0 else link
