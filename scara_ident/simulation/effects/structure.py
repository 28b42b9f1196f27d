"""How the arm stands and what it carries."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.gravity import gravity_size
from scara_ident.effects.links import point_mass
from scara_ident.errors import UsageError
from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.effects.effect import BY_ARM, Effect, Vector, vacant
from scara_ident.simulation.plant import PlantDraft


@dataclass(frozen=True)
class BaseTilt(Effect):
    """A base that is not level: gravity gets the components ``-g tilt_x``, ``-g tilt_y`` and ``-g tilt_z`` along the base's axes.

    g is the size of the robot's gravity, 9.81 where that is zero. Of a base that stands the component along z stays as it is.
    """

    name: ClassVar[str] = "base_tilt"
    units: ClassVar[dict[str, str]] = {"tilt_x": "rad", "tilt_y": "rad", "tilt_z": "rad"}
    whole_arm = "always"
    tilt_x: float = 0.02
    tilt_y: float = -0.01
    tilt_z: float = 0.0

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Add to gravity."""
        nominal = np.asarray(arm.robot.model.gravity.linear)
        vacant(self, float(np.abs(draft.arrays["gravity"] - nominal).max()))
        draft.arrays["gravity"] = draft.arrays["gravity"] - gravity_size(arm.robot) * np.array(
            [self.tilt_x, self.tilt_y, self.tilt_z]
        )


@dataclass(frozen=True)
class Payload(Effect):
    """A rigid body that the last link carries for the whole run, or from one time on, or to one.

    ``com`` and ``inertia`` (xx, xy, xz, yy, yz, zz about the centre of mass) are in the frame of the last link; the
    centre of mass is the tool by default. It comes with the link's velocity and goes with it. A run that starts with it
    starts with the torque that holds it. May be given several times.
    """

    name: ClassVar[str] = "payload"
    units: ClassVar[dict[str, str]] = {"mass": "kg", "time": "s", "com": "m", "inertia": "kg m^2", "until": "s"}
    bounds: ClassVar[dict[str, tuple[float, float]]] = {"mass": (0.0, np.inf), "time": (0.0, np.inf)}
    whole_arm = "always"
    spelled: ClassVar[dict[str, str]] = {"time": "from", "until": "to"}
    mass: float = BY_ARM
    time: float = 0.0
    com: Vector = (BY_ARM,) * 3
    inertia: Vector = (0.0,) * 6
    until: float | None = None

    def sizes(self, arm: VirtualArm, joint: int) -> Mapping[str, float | Vector]:
        """Give a fifth of the mass of the last body, 1 kg at least, at the tool."""
        mass = float(max(0.2 * arm.bodies[np.argmax(arm.robot.order), 0], 1.0))
        return {"mass": mass, "com": tuple(arm.tool.tolist())}

    @property
    def body(self) -> Array:
        """Its standard parameters in the frame of the last link, shape (10,)."""
        xx, xy, xz, yy, yz, zz = self.inertia
        return np.asarray(self.mass * point_mass(np.array(self.com)) + np.array([0, 0, 0, 0, xx, xy, yy, xz, yz, zz]))

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Hang it on the last body."""
        from scara_ident.simulation.spatial import turned_bodies, turned_frames

        xx, xy, xz, yy, yz, zz = self.inertia
        axes = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if axes[0] < -1e-12 or axes[2] > (axes[0] + axes[1]) * (1.0 + 1e-9) + 1e-12:
            raise UsageError(
                f"{self.name}: no body has this inertia; each principal moment must be at most the sum of the others"
            )
        until = np.inf if self.until is None else self.until
        if until <= self.time:
            raise UsageError(f"{self.name}: ends at {until:g} s, before it begins at {self.time:g} s")
        turn = turned_frames(arm.robot.model)[-1][-1:]
        draft.carry(turned_bodies(turn, self.body[None])[0], np.array([self.time, until]))


@dataclass(frozen=True)
class PayloadChange(Payload):
    """A payload that comes during the run, by the name that a diagnosis has for it."""

    name: ClassVar[str] = "payload_change"
    spelled: ClassVar[dict[str, str]] = {"until": "to"}
    time: float = 2.0
