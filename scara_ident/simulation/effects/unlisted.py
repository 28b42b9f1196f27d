"""Effects that no catalogue lists, to test whether a diagnosis says so."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

from scara_ident.simulation.effects.effect import BY_ARM, Effect, vacant

if TYPE_CHECKING:
    from scara_ident.simulation.arm import VirtualArm
    from scara_ident.simulation.plant import PlantDraft


def _other(arm: VirtualArm, joint: str | None) -> int:
    """Return the row of the next joint, of the one before for the last, of itself where it is alone."""
    n, j = arm.robot.n, arm.joint_index(joint or arm.robot.joints[0])
    return int(arm.robot.order[j + 1 if j + 1 < n else max(j - 1, 0)])


@dataclass(frozen=True)
class UnlistedSignedSine(Effect):
    """Dry friction that varies with the other joint's position: ``amplitude sin(3 q_k) sign(v_j)``."""

    name: ClassVar[str] = "unlisted_1"
    equation: ClassVar[str] = "u_j += amplitude sin(3 q_k) sign(v_j)"
    units: ClassVar[dict[str, str]] = {"amplitude": "N m"}
    amplitude: float = BY_ARM

    def sizes(self, arm: VirtualArm, joint: int) -> dict[str, float]:
        """Give a share of the usual torque."""
        return {"amplitude": float(0.06 * arm.torque_scale[joint])}

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Set amplitude and the other joint."""
        j = self.place(arm)
        vacant(self, draft.arrays["signed_sine"][j])
        draft.arrays["signed_sine"][j] = abs(draft.scale[j]) * self.amplitude
        draft.arrays["signed_sine_of"][j] = _other(arm, self.joint)


@dataclass(frozen=True)
class UnlistedSwingingViscous(Effect):
    """Smooth viscous friction that varies with the other joint's position: ``viscous cos(2 q_k) v_j``."""

    name: ClassVar[str] = "unlisted_2"
    equation: ClassVar[str] = "u_j += viscous cos(2 q_k) v_j"
    units: ClassVar[dict[str, str]] = {"viscous": "N m s/rad"}
    viscous: float = BY_ARM

    def sizes(self, arm: VirtualArm, joint: int) -> dict[str, float]:
        """Give a share of the usual torque per unit of speed."""
        return {"viscous": float(0.06 * arm.torque_scale[joint])}

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Set size and the other joint."""
        j = self.place(arm)
        vacant(self, draft.arrays["swinging_viscous"][j])
        draft.arrays["swinging_viscous"][j] = abs(draft.scale[j]) * self.viscous
        draft.arrays["swinging_viscous_of"][j] = _other(arm, self.joint)
