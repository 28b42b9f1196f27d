"""Effects that no catalogue lists, to test whether a diagnosis says so."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.effects.effect import BY_ARM, Effect
from scara_ident.simulation.plant import PlantDraft


@dataclass(frozen=True)
class _OfOtherJoint(Effect):
    """Friction that varies with the position of the next joint, of the one before for the last, of its own where it is alone."""

    # Array of the draft with the row of that joint.
    place_of_other: ClassVar[str]

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Set the size and the other joint."""
        super().apply(arm, draft)
        n, j = arm.robot.n, arm.robot.joint_index(self.joint or arm.robot.joints[0])
        draft.arrays[self.place_of_other][self.place(arm)] = int(arm.robot.order[j + 1 if j + 1 < n else max(j - 1, 0)])


@dataclass(frozen=True)
class UnlistedSignedSine(_OfOtherJoint):
    """Dry friction that varies with the other joint's position: ``amplitude sin(3 q_k) sign(v_j)``."""

    name: ClassVar[str] = "unlisted_1"
    units: ClassVar[dict[str, str]] = {"amplitude": "N m"}
    shares: ClassVar[dict[str, float]] = {"amplitude": 0.06}
    arrays: ClassVar[dict[str, str]] = {"amplitude": "signed_sine"}
    place_of_other = "signed_sine_of"
    joint_side = ("amplitude",)
    amplitude: float = BY_ARM


@dataclass(frozen=True)
class UnlistedSwingingViscous(_OfOtherJoint):
    """Smooth viscous friction that varies with the other joint's position: ``viscous cos(2 q_k) v_j``."""

    name: ClassVar[str] = "unlisted_2"
    units: ClassVar[dict[str, str]] = {"viscous": "N m s/rad"}
    shares: ClassVar[dict[str, float]] = {"viscous": 0.06}
    arrays: ClassVar[dict[str, str]] = {"viscous": "swinging_viscous"}
    place_of_other = "swinging_viscous_of"
    joint_side = ("viscous",)
    viscous: float = BY_ARM
