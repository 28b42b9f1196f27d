"""Torques of masses and first moments under a gravity that is not the robot's."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.model.regressor.derivative import derivative
from scara_ident.model.regressor.kernel import RegressorKernel, build_kernel
from scara_ident.model.regressor.program import Program
from scara_ident.model.regressor.recursion import joint_geometry
from scara_ident.model.regressor.torque import trace_torque
from scara_ident.model.regressor.tracing import Scalar, Trace, compile_program
from scara_ident.model.regressor.vectors import vector
from scara_ident.robot.robot import Robot

# Where a robot's gravity is zero this is how large it is once the base tilts.
STANDARD_GRAVITY = 9.81
# Samples at a time: few enough for the cache.
AT_ONCE = 8192


def gravity_size(robot: Robot) -> float:
    """Return the size of gravity, m/s^2."""
    return float(np.linalg.norm(robot.model.gravity.linear)) or STANDARD_GRAVITY


def pinocchio_columns(robot: Robot, standard: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return Pinocchio's places of the bodies' standard parameters, which stand in the robot's order of joints."""
    return np.asarray(10 * robot.order[standard // 10] + standard % 10, dtype=np.intp)


def first_moments(robot: Robot) -> NDArray[np.intp]:
    """Return the standard parameters that gravity acts on, shape (4 n,): mass and first moments of every body."""
    return np.asarray((10 * np.arange(robot.n)[:, None] + np.arange(4)).ravel(), dtype=np.intp)


@lru_cache(maxsize=8)
def sideways(robot: Robot) -> tuple[tuple[str, Array], tuple[str, Array]]:
    """Return the two directions across gravity, which are those that a base turns it in, and the base's axis nearest each.

    Of a base that stands they are x and y. Of another they are the axes that gravity is least along, in their order, made
    perpendicular to it and to each other (Gram and Schmidt): each a name and a unit vector of shape (3,) in the base's frame.
    """
    gravity = np.asarray(robot.model.gravity.linear, dtype=float)
    size = float(np.linalg.norm(gravity))
    down = gravity / size if size > 0.0 else np.array([0.0, 0.0, -1.0])
    found: list[tuple[str, Array]] = []
    for axis in np.delete(np.arange(3), np.argmax(np.abs(down))):
        along = np.eye(3)[axis]
        for other in (down, *(across for _, across in found)):
            along = along - (along @ other) * other
        found.append(("xyz"[axis], along / np.linalg.norm(along)))
    return found[0], found[1]


@lru_cache(maxsize=8)
def loaded_by_gravity(robot: Robot) -> tuple[bool, ...]:
    """Return which revolute joints gravity loads, from the motion of masses alone."""
    from scara_ident.model.base_parameters import standard_regressor

    rng = np.random.default_rng(0)
    q = np.where(robot.prismatic, 0.3, np.pi)[:, None] * rng.uniform(-1.0, 1.0, (robot.n, 20))
    rest = np.zeros_like(q)
    torque = np.abs(standard_regressor(robot, q, rest, rest)).max(axis=(1, 2))
    largest = float(torque.max(initial=0.0))
    return tuple(bool(largest > 0.0 and torque[j] > 1e-4 * largest and not robot.prismatic[j]) for j in range(robot.n))


@lru_cache(maxsize=8)
def _kernels(robot: Robot) -> tuple[RegressorKernel, RegressorKernel]:
    """Return the kernels of the torque that gravity along minus each of `sideways` gives the `first_moments`."""
    columns = pinocchio_columns(robot, first_moments(robot))
    kernels = []
    for _, direction in sideways(robot):
        model = robot.model.copy()
        model.gravity.linear = -gravity_size(robot) * direction
        kernels.append(build_kernel(model, columns))
    return kernels[0], kernels[1]


def gravity_columns(robot: Robot, axis: int, q: Array) -> Array:
    """Return the torque per mass and first moment under gravity along minus one of two directions across that of the robot.

    Parameters
    ----------
    axis : {0, 1}
        Which of `sideways`.
    q : ndarray, shape (n, N)

    Returns
    -------
    ndarray, shape (n, 4 n, N)
        Recorded side; parameters as `first_moments`.
    """
    rest = np.zeros_like(q)
    columns = _kernels(robot)[axis](q[np.argsort(robot.order)], rest, rest)[robot.order]
    columns *= robot.row_scale[:, None, None]
    return columns


def gravity_torque(robot: Robot, q: Array, gravity: Array, moments: Array, joint: int | None = None) -> Array:
    """Return the torque that holds bodies at rest under a gravity.

    Parameters
    ----------
    q : ndarray, shape (n, N)
        May be of recorded expressions.
    gravity : ndarray, shape (3,)
        Base frame, m/s^2.
    moments : ndarray, shape (4 n,)
        Masses and first moments, as `first_moments`; they need not be those of a possible body.
    joint : int, optional
        With it the derivatives of the torque by the position of this joint.

    Returns
    -------
    ndarray, shape (n, N)
        Recorded side.
    """
    used = tuple(np.flatnonzero(moments).tolist())
    program = _program(robot, used, joint)
    numbers = list(map(np.asarray, np.concatenate([gravity, moments[list(used)]])))
    samples = q.shape[1]
    result = np.empty(q.shape, dtype=q.dtype)
    buffers = np.empty((program.buffers, min(AT_ONCE, samples)), dtype=q.dtype)
    for start in range(0, samples, AT_ONCE):
        part = slice(start, start + AT_ONCE)
        targets = result[:, part]
        program.evaluate([*q[:, part], *numbers], targets, buffers[:, : targets.shape[1]])
    result *= robot.row_scale[:, None]
    return result


@lru_cache(maxsize=128)
def _program(robot: Robot, used: tuple[int, ...], joint: int | None) -> Program:
    """Return `gravity_torque` as code of positions, gravity and those of the moments that are not zero."""
    n, trace = robot.n, Trace()
    q = [trace.variable(k) for k in range(n)]
    gravity = vector(trace.variable(n + k) for k in range(3))
    bodies: list[list[Scalar]] = [[0.0] * 10 for _ in range(n)]
    for k, place in enumerate(used):
        bodies[int(robot.order[place // 4])][place % 4] = trace.variable(n + 3 + k)
    still = [0.0] * n
    found = trace_torque(
        joint_geometry(robot.model), gravity, bodies, [q[j] for j in np.argsort(robot.order)], still, still
    )
    torque = [found[int(place)] for place in robot.order]
    return compile_program(trace, list(enumerate(torque if joint is None else derivative(torque, q[joint]))))
