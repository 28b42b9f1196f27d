"""Bias torques and mass matrix of any arm, compiled: the recursion the virtual arm is integrated with.

Pinocchio sets the convention and checks every arm; it is not called inside the loop because a call from Python
costs more than the whole recursion. Joint frames are turned so that every axis is z, which halves the work.
Recursions: Featherstone, Rigid Body Dynamics Algorithms, 2008, chapters 5 and 6.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.errors import RobotError
from scara_ident.model.regressor.recursion import joint_geometry
from scara_ident.simulation.compiled import compiled, compiled_within

# Largest difference from Pinocchio, relative to the largest torque or inertia of the state.
TOLERANCE = 1e-12


@compiled_within
def rotate(e: Array, i: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Turn a vector by the i-th of ``e``, shape (n, 9): from a joint's frame to its parent's."""
    return (
        e[i, 0] * x + e[i, 1] * y + e[i, 2] * z,
        e[i, 3] * x + e[i, 4] * y + e[i, 5] * z,
        e[i, 6] * x + e[i, 7] * y + e[i, 8] * z,
    )


@compiled_within
def rotate_back(e: Array, i: int, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Turn a vector the other way: from the frame of a joint's parent to its own."""
    return (
        e[i, 0] * x + e[i, 3] * y + e[i, 6] * z,
        e[i, 1] * x + e[i, 4] * y + e[i, 7] * z,
        e[i, 2] * x + e[i, 5] * y + e[i, 8] * z,
    )


@compiled
def dynamics(
    parent: NDArray[np.int64],
    prismatic: NDArray[np.bool_],
    rotation: Array,
    offset: Array,
    bodies: Array,
    gravity: Array,
    q: Array,
    v: Array,
    mass: Array,
    bias: Array,
    e: Array,
    p: Array,
    state: Array,
    composite: Array,
) -> None:
    """Fill the mass matrix ``mass`` (n, n) and the bias torques ``bias`` (n,): Coriolis, centrifugal, gravity.

    Parameters
    ----------
    parent : ndarray of int, shape (n,)
        Parent joint, -1 for the base.
    prismatic : ndarray of bool, shape (n,)
    rotation, offset : ndarray, shape (n, 9) and (n, 3)
        Placement of each joint at position 0 in its parent's frame, rows first.
    bodies : ndarray, shape (n, 10)
        Standard parameters in the turned joint frames, Pinocchio's order.
    gravity : ndarray, shape (3,)
    q, v : ndarray, shape (n,)
    mass, bias : ndarray
        Results.
    e, p, state, composite : ndarray, shape (n, 9), (n, 3), (n, 15), (n, 10)
        Room to work in.
    """
    n = q.shape[0]
    for i in range(n):
        r = rotation[i]
        k = parent[i]
        if prismatic[i]:
            for m in range(9):
                e[i, m] = r[m]
            p[i, 0] = offset[i, 0] + r[2] * q[i]
            p[i, 1] = offset[i, 1] + r[5] * q[i]
            p[i, 2] = offset[i, 2] + r[8] * q[i]
        else:
            c, s = np.cos(q[i]), np.sin(q[i])
            for m in range(3):
                e[i, 3 * m] = r[3 * m] * c + r[3 * m + 1] * s
                e[i, 3 * m + 1] = r[3 * m + 1] * c - r[3 * m] * s
                e[i, 3 * m + 2] = r[3 * m + 2]
            p[i, 0], p[i, 1], p[i, 2] = offset[i, 0], offset[i, 1], offset[i, 2]
        if k < 0:
            wx, wy, wz = 0.0, 0.0, 0.0
            dx, dy, dz = 0.0, 0.0, 0.0
            ax, ay, az = rotate_back(e, i, -gravity[0], -gravity[1], -gravity[2])
        else:
            ux, uy, uz = state[k, 0], state[k, 1], state[k, 2]
            gx, gy, gz = state[k, 3], state[k, 4], state[k, 5]
            px, py, pz = p[i, 0], p[i, 1], p[i, 2]
            cx, cy, cz = uy * pz - uz * py, uz * px - ux * pz, ux * py - uy * px
            ax, ay, az = rotate_back(
                e,
                i,
                state[k, 6] + gy * pz - gz * py + uy * cz - uz * cy,
                state[k, 7] + gz * px - gx * pz + uz * cx - ux * cz,
                state[k, 8] + gx * py - gy * px + ux * cy - uy * cx,
            )
            wx, wy, wz = rotate_back(e, i, ux, uy, uz)
            dx, dy, dz = rotate_back(e, i, gx, gy, gz)
        if prismatic[i]:
            ax += 2.0 * wy * v[i]
            ay -= 2.0 * wx * v[i]
        else:
            dx += wy * v[i]
            dy -= wx * v[i]
            wz += v[i]
        b = bodies[i]
        m, hx, hy, hz = b[0], b[1], b[2], b[3]
        ixx, ixy, iyy, ixz, iyz, izz = b[4], b[5], b[6], b[7], b[8], b[9]
        sx, sy, sz = wy * hz - wz * hy, wz * hx - wx * hz, wx * hy - wy * hx
        jx = ixx * wx + ixy * wy + ixz * wz
        jy = ixy * wx + iyy * wy + iyz * wz
        jz = ixz * wx + iyz * wy + izz * wz
        state[i, 0], state[i, 1], state[i, 2] = wx, wy, wz
        state[i, 3], state[i, 4], state[i, 5] = dx, dy, dz
        state[i, 6], state[i, 7], state[i, 8] = ax, ay, az
        state[i, 9] = m * ax + dy * hz - dz * hy + wy * sz - wz * sy
        state[i, 10] = m * ay + dz * hx - dx * hz + wz * sx - wx * sz
        state[i, 11] = m * az + dx * hy - dy * hx + wx * sy - wy * sx
        state[i, 12] = ixx * dx + ixy * dy + ixz * dz + wy * jz - wz * jy + hy * az - hz * ay
        state[i, 13] = ixy * dx + iyy * dy + iyz * dz + wz * jx - wx * jz + hz * ax - hx * az
        state[i, 14] = ixz * dx + iyz * dy + izz * dz + wx * jy - wy * jx + hx * ay - hy * ax
        for j in range(10):
            composite[i, j] = b[j]
    for i in range(n - 1, -1, -1):
        bias[i] = state[i, 11] if prismatic[i] else state[i, 14]
        c = composite[i]
        if prismatic[i]:
            fx, fy, fz = 0.0, 0.0, c[0]
            tx, ty, tz = c[2], -c[1], 0.0
            mass[i, i] = fz
        else:
            fx, fy, fz = -c[2], c[1], 0.0
            tx, ty, tz = c[7], c[8], c[9]
            mass[i, i] = tz
        j = i
        while True:
            k = parent[j]
            fx, fy, fz = rotate(e, j, fx, fy, fz)
            tx, ty, tz = rotate(e, j, tx, ty, tz)
            px, py, pz = p[j, 0], p[j, 1], p[j, 2]
            tx += py * fz - pz * fy
            ty += pz * fx - px * fz
            tz += px * fy - py * fx
            if k < 0:
                break
            mass[i, k] = fz if prismatic[k] else tz
            mass[k, i] = mass[i, k]
            j = k
        k = parent[i]
        if k >= 0:
            px, py, pz = p[i, 0], p[i, 1], p[i, 2]
            fx, fy, fz = rotate(e, i, state[i, 9], state[i, 10], state[i, 11])
            tx, ty, tz = rotate(e, i, state[i, 12], state[i, 13], state[i, 14])
            state[k, 9] += fx
            state[k, 10] += fy
            state[k, 11] += fz
            state[k, 12] += tx + py * fz - pz * fy
            state[k, 13] += ty + pz * fx - px * fz
            state[k, 14] += tz + px * fy - py * fx
            m = c[0]
            hx, hy, hz = rotate(e, i, c[1], c[2], c[3])
            # I' = E I E^T: the columns of I E^T first, then E times them.
            ax, ay, az = rotate(e, i, c[4], c[5], c[7])
            bx, by, bz = rotate(e, i, c[5], c[6], c[8])
            gx, gy, gz = rotate(e, i, c[7], c[8], c[9])
            ixx, ixy, ixz = rotate(e, i, ax, bx, gx)
            _, iyy, iyz = rotate(e, i, ay, by, gy)
            _, _, izz = rotate(e, i, az, bz, gz)
            along = 2.0 * (hx * px + hy * py + hz * pz) + m * (px * px + py * py + pz * pz)
            composite[k, 0] += m
            composite[k, 1] += hx + m * px
            composite[k, 2] += hy + m * py
            composite[k, 3] += hz + m * pz
            composite[k, 4] += ixx + along - 2.0 * hx * px - m * px * px
            composite[k, 5] += ixy - hx * py - hy * px - m * px * py
            composite[k, 6] += iyy + along - 2.0 * hy * py - m * py * py
            composite[k, 7] += ixz - hx * pz - hz * px - m * px * pz
            composite[k, 8] += iyz - hy * pz - hz * py - m * py * pz
            composite[k, 9] += izz + along - 2.0 * hz * pz - m * pz * pz


# Each model is itself alone, and its geometry is never changed: read joint by joint it takes longer than the rest of a draft.
@lru_cache(maxsize=8)
def turned_frames(model: pin.Model) -> tuple[NDArray[np.int64], NDArray[np.bool_], Array, Array, Array]:
    """Describe a model with every joint axis along z.

    Returns
    -------
    parent : ndarray of int, shape (n,)
    prismatic : ndarray of bool, shape (n,)
    rotation : ndarray, shape (n, 9)
    offset : ndarray, shape (n, 3)
    turn : ndarray, shape (n, 3, 3)
        From the turned joint frame to Pinocchio's.

    Raises
    ------
    RobotError
        If a joint is neither revolute nor prismatic.
    """
    joints = joint_geometry(model)
    turn = np.array([_onto(joint.axis) for joint in joints])
    parent = np.array([joint.parent - 1 for joint in joints], dtype=np.int64)
    before = [turn[k] if k >= 0 else np.eye(3) for k in parent]
    rotation = np.array([b.T @ joint.rotation @ t for b, joint, t in zip(before, joints, turn, strict=True)])
    offset = np.array([b.T @ joint.offset for b, joint in zip(before, joints, strict=True)])
    prismatic = np.array([joint.prismatic for joint in joints], dtype=np.bool_)
    return parent, prismatic, rotation.reshape(-1, 9), offset, turn


def turned_bodies(turn: Array, bodies: Array) -> Array:
    """Express standard parameters, shape (n, 10), in the turned joint frames."""
    result = np.empty_like(bodies)
    for i, (rotation, row) in enumerate(zip(turn, bodies, strict=True)):
        inertia = rotation.T @ row[[4, 5, 7, 5, 6, 8, 7, 8, 9]].reshape(3, 3) @ rotation
        result[i, 0] = row[0]
        result[i, 1:4] = rotation.T @ row[1:4]
        result[i, 4:] = inertia[[0, 0, 1, 0, 1, 2], [0, 1, 1, 2, 2, 2]]
    return result


def mass_and_bias(model: pin.Model, bodies: Array, q: Array, v: Array) -> tuple[Array, Array]:
    """Return mass matrix (n, n) and bias torques (n,) of one state, in Pinocchio's order."""
    parent, prismatic, rotation, offset, turn = turned_frames(model)
    n = len(parent)
    mass, bias = np.zeros((n, n)), np.empty(n)
    room = (np.empty((n, 9)), np.empty((n, 3)), np.empty((n, 15)), np.empty((n, 10)))
    gravity = np.ascontiguousarray(model.gravity.linear)
    turned = turned_bodies(turn, bodies)
    dynamics(parent, prismatic, rotation, offset, turned, gravity, np.array(q), np.array(v), mass, bias, *room)
    return mass, bias


def check_against_pinocchio(model: pin.Model, bodies: Array, *, states: int = 3) -> float:
    """Compare the compiled recursion with Pinocchio on random states.

    Returns
    -------
    float
        Largest relative difference of a mass matrix or bias torque.

    Raises
    ------
    RobotError
        If it exceeds `TOLERANCE`, or nothing that moves has mass or inertia.
    """
    data = model.createData()
    floating = pin.Model(model)
    floating.gravity = pin.Motion.Zero()
    rest, unit = np.zeros(model.nv), np.eye(model.nv)
    random = np.random.default_rng(0)
    worst = 0.0
    for _ in range(states):
        q, v = random.uniform(-2.0, 2.0, model.nv), random.uniform(-2.0, 2.0, model.nv)
        full = configuration(model, q)
        mass, bias = mass_and_bias(model, bodies, q, v)
        expected = np.column_stack([torque_by_regressor(floating, data, bodies, full, rest, a) for a in unit])
        torque = torque_by_regressor(model, data, bodies, full, v, rest)
        # Bias torques may cancel to zero; the size of what cancels is the inertia at these speeds.
        size = np.abs(expected).max()
        if size == 0.0:
            raise RobotError(
                f"{model.name}: no joint moves a link with mass or inertia; give the links <inertial> in the URDF"
            )
        worst = np.maximum(worst, np.abs(mass - expected).max() / size)
        worst = np.maximum(worst, np.abs(bias - torque).max() / max(size, np.abs(torque).max()))
    if not worst <= TOLERANCE:
        raise RobotError(
            f"{model.name}: the compiled dynamics differ from Pinocchio's by {worst:.1e} relative "
            f"(at most {TOLERANCE:.0e} is accepted); please report this robot"
        )
    return worst


def torque_by_regressor(model: pin.Model, data: pin.Data, bodies: Array, full: Array, v: Array, a: Array) -> Array:
    """Return Pinocchio's torque (n,) of bodies with standard parameters, shape (n, 10), in its order.

    By the regressor, which holds for all parameters: torque tells base parameters only, and of the bodies that follow some
    have no mass, or less, which ``pin.Inertia`` cannot be made of.
    """
    rows = pin.computeJointTorqueRegressor(model, data, full, v, a)
    # Of one joint Pinocchio returns a vector.
    return np.asarray(rows.reshape(model.nv, bodies.size) @ bodies.ravel())


def configuration(model: pin.Model, q: Array) -> Array:
    """Return Pinocchio's configuration (nq,) of joint positions (n,): cosine and sine for continuous joints."""
    return np.asarray(pin.integrate(model, pin.neutral(model), np.asarray(q)))


def _onto(axis: Array) -> Array:
    """Return a rotation that takes z onto ``axis``."""
    z = axis / np.linalg.norm(axis)
    helper = np.eye(3)[int(np.argmin(np.abs(z)))]
    x = np.cross(helper, z)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(z, x), z])
