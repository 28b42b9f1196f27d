"""What turns with two joints together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scara_ident.errors import UsageError
from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.effects.effect import BY_ARM, Effect, Vector, neighbour, vacant
from scara_ident.simulation.plant import PlantDraft


@dataclass(frozen=True)
class CoupledShaft(Effect):
    """A shaft that turns with the sum (``sign`` 1) or the difference (-1) of two neighbouring joints' motion.

    With ``w = v_j + sign v_k`` its torque ``inertia dw/dt + viscous w + coulomb sign(w)`` loads joint j, and ``sign`` times
    it loads joint k, both at the joint (Janot, Vandanjon, Gautier 2014, on the wrist of a TX40). Joint k is the next one.
    Without a joint it is the fifth of six, else the last but one. Dry friction grows over 0.1 mrad. Where one of the two
    joints is elastic the inertia turns with the links and the friction is that of the drives.
    """

    name: ClassVar[str] = "coupled_shaft"
    units: ClassVar[dict[str, str]] = {"inertia": "kg m^2", "viscous": "N m s/rad", "coulomb": "N m", "sign": "1"}
    bounds: ClassVar[dict[str, tuple[float, float]]] = {
        "inertia": (0.0, np.inf), "viscous": (0.0, np.inf), "coulomb": (0.0, np.inf), "sign": (-1.0, 1.0),
    }  # fmt: skip
    inertia: float = BY_ARM
    viscous: float = BY_ARM
    coulomb: float = BY_ARM
    sign: float = 1.0

    def sizes(self, arm: VirtualArm, joint: int) -> Mapping[str, float | Vector]:
        """Give a third of rotor and friction of the joint that has less, or shares of its torque where it has none."""
        n = arm.robot.n
        pair = [joint, joint + 1 if joint + 1 < n else max(joint - 1, 0)]
        size = np.abs(arm.scale[pair])
        scale = float(np.min(size * arm.torque_scale[pair]))
        return {
            "inertia": float(0.3 * arm.armature[pair].min() or 0.01 * scale),
            "viscous": float(0.3 * np.min(size * arm.friction[pair, 1]) or 0.02 * scale),
            "coulomb": float(0.3 * np.min(size * arm.friction[pair, 0]) or 0.02 * scale),
        }

    def first_choice(self, arm: VirtualArm) -> str:
        """Take the wrist."""
        return arm.robot.joints[4 if arm.robot.n == 6 else max(arm.robot.n - 2, 0)]

    def other(self, arm: VirtualArm) -> str:
        """Name of the other joint."""
        return neighbour(self, arm)

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Append the shaft."""
        if abs(self.sign) != 1.0:
            raise UsageError(f"{self.name}: sign is {self.sign:g}; expected 1 for the sum or -1 for the difference")
        j, k = self.place(arm), int(arm.robot.order[arm.robot.joint_index(self.other(arm))])
        pairs = zip(draft.arrays["shaft_joint"], draft.arrays["shaft_other"], strict=True)
        vacant(self, float(any({int(i), int(o)} == {j, k} for i, o in pairs)))
        if self.inertia or self.viscous or self.coulomb:
            draft.append("shaft", j, k, self.sign, self.inertia, self.viscous, self.coulomb)
