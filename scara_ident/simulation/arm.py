"""The virtual arm: what it is made of, its friction, its drives, encoders and controller."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.errors import RobotError, UsageError
from scara_ident.manners import Frozen, several
from scara_ident.robot.robot import Robot
from scara_ident.simulation.plant import PlantDraft, empty_draft

if TYPE_CHECKING:
    from scara_ident.simulation.loop import Gains


@dataclass(frozen=True, eq=False)
class Controller:
    """A decentralised PID of every joint in discrete time.

    Attributes
    ----------
    proportional, integral, derivative : ndarray, shape (n,)
        N m/rad, N m/(rad s), N m s/rad, at the joint.
    cutoff, damping : float
        Natural frequency, Hz, and damping factor of the low-pass on the differentiated encoder position.
    """

    proportional: Array
    integral: Array
    derivative: Array
    cutoff: float = 100.0
    damping: float = 1.0

    def faster(self, factor: float) -> Controller:
        """Return a controller with its poles times a factor: gains by its powers."""
        return replace(
            self,
            proportional=factor**2 * self.proportional,
            integral=factor**3 * self.integral,
            derivative=factor * self.derivative,
        )

    def gains(self, rate: float, order: NDArray[np.intp]) -> Gains:
        """Return the loop's gains in Pinocchio's order, the filter for ``rate`` samples per second."""
        from scara_ident.simulation.loop import Gains, velocity_filter

        if not 0.0 < self.cutoff < 0.5 * rate:
            raise UsageError(f"the velocity filter's {self.cutoff:g} Hz must be under half the rate of {rate:g} Hz")
        back = np.argsort(order)
        return Gains(
            self.proportional[back],
            self.integral[back],
            self.derivative[back],
            velocity_filter(rate, self.cutoff, self.damping),
        )


@dataclass(frozen=True, eq=False, repr=False)
class VirtualArm(Frozen):
    """A simulated arm with known parameters.

    Rows are in the robot's order of joints. Torques are on the robot's effort side; friction is a polynomial of the
    joint's speed in the motor's direction (equation 3 of Indri et al. 2002).

    Attributes
    ----------
    robot : Robot
        Kinematics, gravity, reductions, the effort side and its gains. Its inertias are the nominal ones.
    bodies : ndarray, shape (n, 10)
        Standard parameters of the moved bodies, Pinocchio's order within a body.
    rotor_inertia : ndarray, shape (n,)
        kg m^2 on the motor side.
    friction : ndarray, shape (n, 4)
        a0, a1, a2, a3.
    torque_offset : ndarray, shape (n,)
        Added to the recorded torque, N m.
    encoder_steps : ndarray, shape (n,)
        Steps per motor turn; 0 for an encoder without steps.
    torque_noise : ndarray, shape (n,)
        Standard deviation of the recorded torque, N m, white.
    controller : Controller
    torque_scale : ndarray, shape (n,)
        A typical torque of each joint, N m, which sets the default sizes of effects.
    tool : ndarray, shape (3,)
        The tool point in the frame of the last joint (Pinocchio's frame of the last joint in Pinocchio's order), m.
    """

    robot: Robot
    bodies: Array
    rotor_inertia: Array
    friction: Array
    torque_offset: Array
    encoder_steps: Array
    torque_noise: Array
    controller: Controller
    torque_scale: Array
    tool: Array

    def __post_init__(self) -> None:
        n = self.robot.n
        shapes = {"bodies": (n, 10), "friction": (n, 4), "tool": (3,)}
        for name in ("rotor_inertia", "torque_offset", "encoder_steps", "torque_noise", "torque_scale"):
            shapes[name] = (n,)
        for name, shape in shapes.items():
            value = np.array(getattr(self, name), dtype=float)
            if value.shape != shape:
                raise RobotError(f"{self.robot.name}: {name} has shape {value.shape}; expected {shape}")
            if not np.all(np.isfinite(value)):
                raise RobotError(f"{self.robot.name}: {name} has a value that is not finite")
            value.setflags(write=False)
            object.__setattr__(self, name, value)
        for name in ("rotor_inertia", "encoder_steps", "torque_noise"):
            if np.any(getattr(self, name) < 0.0):
                raise RobotError(f"{self.robot.name}: {name} must not be negative")

    def _in_short(self) -> str:
        return f"{self.robot.name}: {several(self.robot.n, 'joint')}"

    @property
    def scale(self) -> Array:
        """Torque at the joint per torque on the effort side, shape (n,): N on the motor side, else 1."""
        return 1.0 / self.robot.row_scale

    @property
    def armature(self) -> Array:
        """Rotor inertia seen at the joint, N^2 Jm, shape (n,)."""
        return np.asarray(self.robot.reduction**2 * self.rotor_inertia)

    @property
    def encoder_resolution(self) -> Array:
        """Joint position per encoder step, shape (n,), rad or m; 0 without steps."""
        steps = np.where(self.encoder_steps > 0.0, self.encoder_steps, np.inf)
        return np.asarray(2.0 * np.pi / steps / np.abs(self.robot.reduction))

    @property
    def radian(self) -> Array:
        """The motion that corresponds to one radian, shape (n,).

        1 for a revolute joint, the stroke divided by pi, m, for a prismatic one. Default lengths of effects are multiples of it. A prismatic joint without limits has a stroke of a metre.
        """
        stroke = self.robot.upper - self.robot.lower
        return np.where(self.robot.prismatic, np.where(np.isfinite(stroke), stroke, 1.0) / np.pi, 1.0)

    def link_inertia(self) -> Array:
        """Return the diagonal of the links' mass matrix at the neutral pose, without rotors, shape (n,)."""
        from scara_ident.simulation.spatial import mass_and_bias

        zero = np.zeros(self.robot.n)
        mass, _ = mass_and_bias(self.robot.model, self.bodies[np.argsort(self.robot.order)], zero, zero)
        return np.asarray(np.diag(mass)[self.robot.order])

    def draft(self) -> PlantDraft:
        """Return the arm without effects as arrays of the loop, Pinocchio's order, joint side."""
        from scara_ident.simulation.spatial import check_against_pinocchio, turned_bodies, turned_frames

        robot = self.robot
        back = np.argsort(robot.order)
        draft = empty_draft(robot.n, self.scale[back], robot.reduction[back])
        parent, prismatic, rotation, offset, turn = turned_frames(robot.model)
        check_against_pinocchio(robot.model, self.bodies[back])
        size = np.abs(draft.scale)
        draft.arrays |= {
            "parent": np.asarray(parent, dtype=float),
            "prismatic": np.asarray(prismatic, dtype=float),
            "rotation": rotation,
            "offset": offset,
            "bodies": turned_bodies(turn, self.bodies[back]),
            "gravity": np.array(robot.model.gravity.linear),
            "armature": self.armature[back],
            "friction": size[:, None] * self.friction[back],
            "constant": draft.scale * self.torque_offset[back],
        }
        draft.sensors["resolution"] = self.encoder_resolution[back]
        draft.sensors["torque_limit"] = robot.effort_limit[back]
        return draft


def on_side(arm: VirtualArm, side: Literal["motor", "joint"]) -> VirtualArm:
    """Return the same arm with its torque recorded, and its constants given, on the other side of the gears."""
    robot = replace(arm.robot, effort_side=side)
    factor = arm.scale * robot.row_scale
    size = np.abs(factor)
    return replace(
        arm,
        robot=robot,
        friction=size[:, None] * arm.friction,
        torque_offset=factor * arm.torque_offset,
        torque_noise=size * arm.torque_noise,
        torque_scale=size * arm.torque_scale,
    )


def ideal(arm: VirtualArm) -> VirtualArm:
    """Return the arm with encoders without steps and torque without noise."""
    zero = np.zeros(arm.robot.n)
    return replace(arm, encoder_steps=zero, torque_noise=zero)
