"""A constant force on the tool, as of a hose or a balancer that pulls it."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.effect import Effect
from scara_ident.effects.gravity import first_moments, pinocchio_columns
from scara_ident.effects.links import tool_of
from scara_ident.effects.parameters import Coefficient, Member
from scara_ident.effects.signals import Scene, Signals
from scara_ident.model.regressor.kernel import RegressorKernel, build_kernel
from scara_ident.robot.robot import Robot


class ToolForce(Effect):
    """A force on the tool that is the same in size and direction, base frame, wherever the arm is.

    It is no part of an arm and in no catalogue. A base that leans pulls sideways at all links, each by its mass: with few or slow
    recordings the one may be taken for the other.
    """

    name = "tool_force"
    summary = "a constant force on the tool"
    coefficients = tuple(Coefficient(f"force_{axis}", "N", f"force along the base's {axis}") for axis in "xyz")
    all_joints = True
    on_links = True
    of_position = True
    of_state = True
    smooth = True
    not_simulated = "it is not a property of the arm: use a push without end"

    def members(self, scene: Scene) -> tuple[Member, ...]:
        """Return that of all joints."""
        return (Member(None),)

    def signal_columns(self, signals: Signals, member: Member) -> Iterable[Array]:
        """Return what the drives give to hold one newton along each axis of the base."""
        return list(force_torque(signals.scene.robot, signals.motion.q))


@lru_cache(maxsize=8)
def _kernels(robot: Robot) -> tuple[RegressorKernel, ...]:
    """Return the kernels of the torque by mass and first moments of the last link, under 1 m/s^2 against each axis of the base."""
    last = first_moments(robot).reshape(robot.n, 4)[tool_of(robot).joint]
    kernels = []
    for direction in np.eye(3):
        model = robot.model.copy()
        model.gravity.linear = direction
        kernels.append(build_kernel(model, pinocchio_columns(robot, last)))
    return tuple(kernels)


def force_torque(robot: Robot, q: Array) -> Array:
    """Return what the drives give to hold 1 N on the tool along each axis of the base, recorded side.

    Of 1 kg at the tool, under a gravity of 1 m/s^2 along the force.

    Parameters
    ----------
    q : ndarray, shape (n, N)

    Returns
    -------
    ndarray, shape (3, n, N)
    """
    rest, point = np.zeros_like(q), np.array([1.0, *tool_of(robot).point])
    of_bodies = [kernel(q[np.argsort(robot.order)], rest, rest) for kernel in _kernels(robot)]
    return np.array([(point @ columns)[robot.order] * robot.row_scale[:, None] for columns in of_bodies])
