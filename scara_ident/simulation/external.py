"""What acts on the links beside their own drives: forces from outside, what the last one carries, shafts between joints."""

from __future__ import annotations

import numpy as np

from scara_ident.arrays import Array
from scara_ident.simulation.compiled import compiled_within
from scara_ident.simulation.plant import Plant
from scara_ident.simulation.spatial import rotate, rotate_back

# Times closer than this are the same, s.
SAME_TIME = 1e-9
# Way over which the dry friction of a shaft grows to 1 - 1/e of its size, rad (m): short beside any motion.
SHAFT_WAY = 1e-4


@compiled_within
def carry(plant: Plant, t: float, bodies: Array) -> None:
    """Fill ``bodies``, shape (n, 10), with the plant's own and what the last one carries from ``t`` on."""
    n = bodies.shape[0]
    for i in range(n):
        for j in range(10):
            bodies[i, j] = plant.bodies[i, j]
    for k in range(plant.payload_span.shape[0]):
        if plant.payload_span[k, 0] <= t + SAME_TIME < plant.payload_span[k, 1]:
            for j in range(10):
                bodies[n - 1, j] += plant.payload_body[k, j]


@compiled_within
def until_change(plant: Plant, t: float, left: float) -> float:
    """Return how long, at most ``left``, the arm carries what it does at ``t``."""
    for k in range(plant.payload_span.shape[0]):
        for edge in plant.payload_span[k]:
            if SAME_TIME < edge - t < left - SAME_TIME:
                left = edge - t
    return left


@compiled_within
def push(plant: Plant, t: float, e: Array, p: Array, force: Array, bias: Array) -> None:
    """Take the torques ``J^T f`` of pushes off the bias torques.

    A force grows from nothing and falls to it by half a cosine.

    Parameters
    ----------
    e, p : ndarray, shape (n, 9) and (n, 3)
        Placements of the joints, as `dynamics` leaves them.
    force : ndarray, shape (n, 3)
        Room to work in.
    bias : ndarray, shape (n,)
    """
    for k in range(plant.push_joint.shape[0]):
        begin, end, edge = plant.push_time[k]
        if not begin < t < end:
            continue
        part = min(t - begin, end - t) / edge
        size = 0.5 - 0.5 * np.cos(np.pi * part) if part < 1.0 else 1.0
        link = plant.push_joint[k]
        for i in range(link + 1):
            f = force[plant.parent[i]] if plant.parent[i] >= 0 else plant.push_force[k]
            force[i, 0], force[i, 1], force[i, 2] = rotate_back(e, i, f[0], f[1], f[2])
        x, y, z = plant.push_point[k]
        while link >= 0:
            f = force[link]
            bias[link] -= size * (f[2] if plant.prismatic[link] else x * f[1] - y * f[0])
            x, y, z = rotate(e, link, x, y, z)
            x, y, z = x + p[link, 0], y + p[link, 1], z + p[link, 2]
            link = plant.parent[link]


@compiled_within
def shaft_inertia(plant: Plant, mass: Array) -> None:
    """Add the inertia of what turns with two joints together to the mass matrix."""
    for k in range(plant.shaft_joint.shape[0]):
        i, j, size = plant.shaft_joint[k], plant.shaft_other[k], plant.shaft_inertia[k]
        mass[i, i] += size
        mass[j, j] += size
        mass[i, j] += plant.shaft_sign[k] * size
        mass[j, i] += plant.shaft_sign[k] * size


@compiled_within
def shaft_friction(plant: Plant, theta: Array, omega: Array, start: Array, dahl: Array, smooth: Array) -> None:
    """Add the friction of what turns with two joints together to the torques of their drives.

    Dry friction grows over `SHAFT_WAY` (Dahl 1968), from its states ``dahl`` at the positions ``start``, so that a shaft
    need not be stopped and let go beside the joints.
    """
    for k in range(plant.shaft_joint.shape[0]):
        i, j, sign = plant.shaft_joint[k], plant.shaft_other[k], plant.shaft_sign[k]
        direction = slid(dahl[k], theta[i] - start[i] + sign * (theta[j] - start[j]), SHAFT_WAY)
        torque = plant.shaft_viscous[k] * (omega[i] + sign * omega[j]) + plant.shaft_coulomb[k] * direction
        smooth[i] += torque
        smooth[j] += sign * torque


@compiled_within
def slid(before: float, way: float, distance: float) -> float:
    """Return Dahl's state after a way in one direction, exactly."""
    end = 1.0 if way > 0.0 else (-1.0 if way < 0.0 else 0.0)
    after: float = end - (end - before) * np.exp(-abs(way) / distance)
    return after
