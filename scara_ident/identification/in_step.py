"""Joints that move in proportion: what each of them does to the torques is told apart by nothing but noise."""

from __future__ import annotations

import numpy as np

from scara_ident.arrays import Array
from scara_ident.motion.prepared import PreparedData
from scara_ident.robot.robot import Robot

# Of a joint that moves in proportion to another, at most this share of its velocity (rms) is its own. Standard deviations of
# what tells their accelerations, or their products, apart are then a hundred times those of independent motions or more.
OWN_SHARE = 0.01
# A joint this much slower than the fastest, as a share, hardly moves: its noise is its own.
SLOWER = 1e-3


def in_step(robot: Robot, data: PreparedData) -> list[str]:
    """Say which joints move in proportion in all recordings, group by group.

    Parameters
    ----------
    data : PreparedData
        The fitted recordings, in their bands.
    """
    return [
        f"{', '.join(robot.joints[j] for j in group)} move in proportion in all recordings: what each does to the torques is "
        "hardly told apart, so the model may not hold for other motions; record motions of different frequencies"
        for group in groups(
            sum(
                (_products(part.motion.v, part.trim) for part in data.stretches if part.usable),
                np.zeros((robot.n, robot.n)),
            )
        )
    ]


def groups(products: Array) -> list[list[int]]:
    """Return the joints whose velocities are in proportion, two or more in each group.

    Parameters
    ----------
    products : ndarray, shape (n, n)
        Sums of the products of velocities.
    """
    squares = np.diag(products)
    moving = np.flatnonzero(squares > SLOWER**2 * np.max(squares, initial=0.0)).tolist()
    found: list[list[int]] = []
    for j in moving:
        for group in found:
            first = group[0]
            if 1.0 - products[first, j] ** 2 / (squares[first] * squares[j]) < OWN_SHARE**2:
                group.append(j)
                break
        else:
            found.append([j])
    return [group for group in found if len(group) > 1]


def _products(velocity: Array, trim: int) -> Array:
    inside = velocity[:, trim : velocity.shape[1] - trim]
    return np.asarray(inside @ inside.T)
