"""How the arm stands and what it carries."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scara_ident.effects.links import gravity_size, point_mass
from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.effects.effect import BY_ARM, Effect, vacant
from scara_ident.simulation.plant import PlantDraft


@dataclass(frozen=True)
class BaseTilt(Effect):
    """A base that is not level: gravity gets the components ``-g tilt_x`` and ``-g tilt_y`` along the base's x and y.

    g is the size of the robot's gravity, 9.81 where that is zero; the component along z stays as it is.
    """

    name: ClassVar[str] = "base_tilt"
    equation: ClassVar[str] = "gravity += (-g tilt_x, -g tilt_y, 0)"
    units: ClassVar[dict[str, str]] = {"tilt_x": "rad", "tilt_y": "rad"}
    whole_arm = "always"
    tilt_x: float = 0.02
    tilt_y: float = -0.01

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Add to gravity."""
        nominal = np.asarray(arm.robot.model.gravity.linear)
        vacant(self, float(np.abs(draft.arrays["gravity"] - nominal).max()))
        draft.arrays["gravity"] = draft.arrays["gravity"] - gravity_size(arm.robot) * np.array(
            [self.tilt_x, self.tilt_y, 0.0]
        )


@dataclass(frozen=True)
class PayloadChange(Effect):
    """A point mass that the tool point carries from a time in the run on."""

    name: ClassVar[str] = "payload_change"
    equation: ClassVar[str] = "bodies += point mass at the tool for t >= time"
    units: ClassVar[dict[str, str]] = {"mass": "kg", "time": "s"}
    bounds: ClassVar[dict[str, tuple[float, float]]] = {"mass": (0.0, np.inf), "time": (0.0, np.inf)}
    whole_arm = "always"
    mass: float = BY_ARM
    time: float = 2.0

    def sizes(self, arm: VirtualArm, joint: int) -> dict[str, float]:
        """Give a fifth of the mass of the last body, 1 kg at least."""
        return {"mass": float(max(0.2 * arm.bodies[np.argmax(arm.robot.order), 0], 1.0))}

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Prepare the bodies after the change."""
        from scara_ident.simulation.spatial import turned_bodies, turned_frames

        vacant(self, float(draft.arrays["payload_time"]), np.inf)
        back = np.argsort(arm.robot.order)
        bodies = arm.bodies[back].copy()
        bodies[-1] += self.mass * point_mass(arm.tool)
        draft.arrays["bodies_after"] = turned_bodies(turned_frames(arm.robot.model)[-1], bodies)
        draft.arrays["payload_time"] = np.array(self.time)
