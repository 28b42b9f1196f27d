"""What comes to the links from outside the arm: forces on them, and what the last one carries."""

from __future__ import annotations

import numpy as np

from scara_ident.arrays import Array
from scara_ident.simulation.compiled import compiled
from scara_ident.simulation.plant import Plant
from scara_ident.simulation.spatial import rotate, rotate_back

# Times closer than this are the same, s.
SAME = 1e-9


@compiled
def carry(plant: Plant, t: float, bodies: Array) -> None:
    """Fill ``bodies``, shape (n, 10), with the plant's own and what the last one carries from ``t`` on."""
    bodies[:] = plant.bodies
    for k in range(plant.payload_span.shape[0]):
        begin, end = plant.payload_span[k]
        if begin <= t + SAME < end:
            bodies[-1] += plant.payload_body[k]


@compiled
def until_change(plant: Plant, t: float, left: float) -> float:
    """Return how long, at most ``left``, the arm carries what it does at ``t``."""
    for k in range(plant.payload_span.shape[0]):
        for edge in plant.payload_span[k]:
            if SAME < edge - t < left - SAME:
                left = edge - t
    return left


@compiled
def push(plant: Plant, t: float, e: Array, p: Array, force: Array, bias: Array) -> None:
    """Take the torques ``J^T f`` of pushes off the bias torques.

    A force grows from nothing and falls to it by half a cosine.

    Parameters
    ----------
    t : float
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
