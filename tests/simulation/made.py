"""Arms, motions and an inverse dynamics by Pinocchio for the tests of the virtual arm."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scara_ident.robot.robot import Robot, load_robot
from scara_ident.simulation import ReferenceMotion, TrueMotion, VirtualArm, ideal, sampled, virtual_arm
from scara_ident.simulation.inverse_dynamics import inverse_dynamics
from tests.arms import Link, rnea, write_urdf

Array = NDArray[np.float64]

TREE = (
    Link(axis=(0.2, 0.1, 1.0), xyz=(0.0, 0.1, 0.2), mass=6.0, com=(0.1, 0.05, 0.02)),
    Link(kind="prismatic", axis=(1.0, 0.0, 0.4), xyz=(0.2, 0.0, 0.1), rpy=(0.3, -0.2, 0.5), mass=3.0),
    Link(axis=(0.0, 1.0, 0.0), xyz=(0.1, 0.0, 0.1), rpy=(0.1, 0.4, 0.0), mass=2.0),
    Link(kind="continuous", axis=(-1.0, 0.0, 0.0), xyz=(-0.1, 0.2, 0.0), mass=1.5, parent=0),
)
"""A branched arm with tilted axes, a prismatic and an unlimited joint."""


@cache
def scara() -> VirtualArm:
    """Return the SCARA03 without noise and encoder steps."""
    return ideal(virtual_arm())


def tree(folder: Path) -> Robot:
    """Return the branched arm."""
    return load_robot(write_urdf(folder / "tree.urdf", TREE))


def bare(arm: VirtualArm) -> VirtualArm:
    """Return the arm without friction and offset."""
    return replace(arm, friction=np.zeros((arm.robot.n, 4)), torque_offset=np.zeros(arm.robot.n))


def swing(robot: Robot, duration: float = 4.0, amplitude: float = 0.6, name: str = "swing") -> ReferenceMotion:
    """Return a motion from rest of sums of two cosines around the middle of the range."""
    lower = np.where(np.isfinite(robot.lower), robot.lower, -np.pi)
    upper = np.where(np.isfinite(robot.upper), robot.upper, np.pi)
    middle = 0.5 * (lower + upper)[:, None]
    size = np.where(robot.prismatic, 0.3, 1.0)[:, None] * amplitude
    w = np.linspace(1.6, 2.3, robot.n)[:, None]

    def function(t: Array) -> tuple[Array, Array, Array]:
        q, v, a = middle + 0.0 * t, 0.0 * w * t, 0.0 * w * t
        for share, factor in ((1.0, 1.0), (0.35, 2.7)):
            k = factor * w
            q = q + share * size * (1.0 - np.cos(k * t))
            v = v + share * size * k * np.sin(k * t)
            a = a + share * size * k * k * np.cos(k * t)
        return q, v, a

    return sampled(name, robot, function, duration)


def rigid(arm: VirtualArm, q: Array, v: Array, a: Array) -> Array:
    """Torque of links and rotors by Pinocchio on the effort side, of an arm whose bodies are those of its URDF."""
    return (rnea(arm.robot, q, v, a) + arm.armature[:, None] * a) * arm.robot.row_scale[:, None]


def friction(arm: VirtualArm, v: Array, direction: Array | None = None) -> Array:
    """Polynomial friction on the effort side; ``direction`` stands for sign(v) in the Coulomb part."""
    side = arm.robot.drive_sign[:, None]
    a0, a1, a2, a3 = (arm.friction[:, i, None] for i in range(4))
    sign = np.sign(v) if direction is None else direction
    return side * (a0 * sign + a1 * v + a2 * np.abs(v) * v + a3 * v**3)


def left_over(arm: VirtualArm, true: TrueMotion) -> Array:
    """Torque that rigid bodies, rotors, polynomial friction and offset do not explain, NaN where a joint sticks."""
    u = true.effort - rigid(arm, true.position, true.velocity, true.acceleration)
    u = u - friction(arm, true.velocity, true.direction) - arm.torque_offset[:, None]
    u[true.direction == 0.0] = np.nan
    return u


def nominal_torque(arm: VirtualArm, motion: ReferenceMotion) -> Array:
    """Return the torque of the URDF's bodies with the arm's rotors and friction, at the joint, shape (n, N)."""
    nominal = arm.robot.standard_parameters()[: 10 * arm.robot.n].reshape(-1, 10)
    return inverse_dynamics(arm, nominal, motion.position, motion.velocity, motion.acceleration)
