"""Friction beyond a polynomial of the joint's own speed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.effects.effect import BY_ARM, Effect, Vector, neighbour, vacant
from scara_ident.simulation.plant import PlantDraft


@dataclass(frozen=True)
class Stribeck(Effect):
    """More friction at low speed: ``amplitude sign(v) exp(-(v/velocity)^2)``."""

    name: ClassVar[str] = "stribeck"
    units: ClassVar[dict[str, str]] = {"amplitude": "N m", "velocity": "rad/s"}
    bounds: ClassVar[dict[str, tuple[float, float]]] = {"amplitude": (0.0, np.inf), "velocity": (1e-6, np.inf)}
    ways: ClassVar[dict[str, float]] = {"velocity": 0.1}
    arrays: ClassVar[dict[str, str]] = {"amplitude": "stribeck_amplitude", "velocity": "stribeck_velocity"}
    joint_side = ("amplitude",)
    amplitude: float = BY_ARM
    velocity: float = BY_ARM

    def sizes(self, arm: VirtualArm, joint: int) -> Mapping[str, float | Vector]:
        """Give half of the Coulomb friction, or a share of the torque where there is none."""
        amplitude = float(0.5 * arm.friction[joint, 0] or 0.05 * arm.torque_scale[joint])
        return {**super().sizes(arm, joint), "amplitude": amplitude}


@dataclass(frozen=True)
class AsymmetricFriction(Effect):
    """Viscous friction that differs by direction: ``viscous_difference / 2 |v|``.

    The direction is the motor's, as for all friction; it matters where the gear reverses.
    """

    name: ClassVar[str] = "asymmetric_friction"
    units: ClassVar[dict[str, str]] = {"viscous_difference": "N m s/rad"}
    viscous_difference: float = BY_ARM

    def sizes(self, arm: VirtualArm, joint: int) -> dict[str, float]:
        """Give two fifths of the viscous friction."""
        return {"viscous_difference": float(0.4 * arm.friction[joint, 1] or 0.03 * arm.torque_scale[joint])}

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Set the difference."""
        j = self.place(arm)
        vacant(self, draft.arrays["asymmetry"][j])
        draft.arrays["asymmetry"][j] = 0.5 * draft.scale[j] * self.viscous_difference


@dataclass(frozen=True)
class Presliding(Effect):
    """Dry friction that builds up over a distance, with a state z (Dahl 1968).

    ``dz/dt = v/distance (1 - z sign(v))``, and all dry friction of the joint is times z where it was times sign(v).
    The joint then never sticks; it creeps elastically.
    """

    name: ClassVar[str] = "presliding"
    units: ClassVar[dict[str, str]] = {"presliding_distance": "rad"}
    bounds: ClassVar[dict[str, tuple[float, float]]] = {"presliding_distance": (0.0, np.inf)}
    ways: ClassVar[dict[str, float]] = {"presliding_distance": 0.005}
    arrays: ClassVar[dict[str, str]] = {"presliding_distance": "presliding"}
    presliding_distance: float = BY_ARM


@dataclass(frozen=True)
class SmoothCoulomb(Effect):
    """Dry friction without a jump: all of it is times ``tanh(v/velocity)`` where it was times sign(v). The joint then never sticks."""

    name: ClassVar[str] = "smooth_coulomb"
    units: ClassVar[dict[str, str]] = {"velocity": "rad/s"}
    bounds: ClassVar[dict[str, tuple[float, float]]] = {"velocity": (0.0, np.inf)}
    ways: ClassVar[dict[str, float]] = {"velocity": 0.05}
    arrays: ClassVar[dict[str, str]] = {"velocity": "smooth_velocity"}
    velocity: float = BY_ARM


@dataclass(frozen=True)
class WarmUp(Effect):
    """Friction that is larger at the start of a run: the polynomial times ``1 + share exp(-t/time_constant)``."""

    name: ClassVar[str] = "warm_up"
    units: ClassVar[dict[str, str]] = {"share": "1", "time_constant": "s"}
    bounds: ClassVar[dict[str, tuple[float, float]]] = {"share": (-1.0, np.inf), "time_constant": (1e-6, np.inf)}
    arrays: ClassVar[dict[str, str]] = {"share": "warm_share", "time_constant": "warm_time"}
    share: float = 0.3
    time_constant: float = 8.0


@dataclass(frozen=True)
class PositionDependentFriction(Effect):
    """Coulomb friction that varies with the joint's position: a0 times ``1 + share sin(q + phase)``.

    Where the joint slides, q is ``pi`` times its position over its stroke.
    """

    name: ClassVar[str] = "position_dependent_friction"
    units: ClassVar[dict[str, str]] = {"share": "1", "phase": "rad"}
    bounds: ClassVar[dict[str, tuple[float, float]]] = {"share": (-1.0, 1.0)}
    arrays: ClassVar[dict[str, str]] = {"share": "position_share", "phase": "position_phase"}
    share: float = 0.3
    phase: float = 0.5

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Set share and phase, and over which way they are."""
        super().apply(arm, draft)
        draft.array("position_order")[self.place(arm)] = (
            1.0 / arm.radian[arm.robot.joint_index(self.joint or arm.robot.joints[0])]
        )


@dataclass(frozen=True)
class FrictionCoupling(Effect):
    """Friction of a joint driven by the other joint's velocity: ``viscous v_k + coulomb sign(v_k)``.

    The other joint k is the next one, for the last joint the one before it.
    """

    name: ClassVar[str] = "friction_coupling"
    units: ClassVar[dict[str, str]] = {"viscous": "N m s/rad", "coulomb": "N m"}
    viscous: float = BY_ARM
    coulomb: float = BY_ARM

    def sizes(self, arm: VirtualArm, joint: int) -> dict[str, float]:
        """Give small shares of the joint's own friction."""
        scale = float(arm.torque_scale[joint])
        # By the other joint's speed, which may be in another unit.
        way = float(arm.radian[joint] / arm.radian[arm.robot.joint_index(self.other(arm))])
        return {
            "viscous": float(0.3 * arm.friction[joint, 1] * way or 0.02 * scale),
            "coulomb": float(0.15 * arm.friction[joint, 0] or 0.02 * scale),
        }

    def other(self, arm: VirtualArm) -> str:
        """Name of the joint whose velocity drives the friction."""
        return neighbour(self, arm)

    def apply(self, arm: VirtualArm, draft: PlantDraft) -> None:
        """Set the row of the coupling matrices."""
        j, k = self.place(arm), int(arm.robot.order[arm.robot.joint_index(self.other(arm))])
        vacant(self, draft.arrays["coupling_viscous"][j, k] or draft.arrays["coupling_coulomb"][j, k])
        draft.arrays["coupling_viscous"][j, k] = draft.scale[j] * self.viscous
        draft.arrays["coupling_coulomb"][j, k] = draft.scale[j] * self.coulomb
