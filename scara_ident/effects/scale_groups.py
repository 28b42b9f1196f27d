"""Joints whose torque scales can be compared: those that share parameters of the bodies."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from scara_ident.effects.spanned import ABSORBED_SHARE, random_motion, rows_by_sample
from scara_ident.model.terms import RigidBody

# Of a direction that all rows leave out only rounding is left, as a share of the largest singular value.
ROUNDING = 1e-6
# Joints of one group are wholly correlated in what no row says, and those of two not at all.
SAME_GROUP_SHARE = 0.5


@lru_cache(maxsize=16)
def scale_groups(term: RigidBody, moving: tuple[bool, ...]) -> tuple[tuple[int, ...], ...]:
    """Return the joints whose torque scales rigid bodies compare, as groups in the order of their first joints.

    A scale that all joints of a group have goes into the bodies' parameters, and nothing compares it with those of others. So of two
    joints nothing tells whose is wrong, and of one nothing tells its scale.

    Parameters
    ----------
    term : RigidBody
    moving : tuple of bool
        Which joints move; one that rests says nothing, and is alone.

    Notes
    -----
    With the torque of every joint in a column of its own, at random states and parameters, the sum over a group is spanned by the
    bodies' columns, and no smaller sum is: the null space of what they leave is that of the groups. Columns are of unit length
    and rows of each joint of unit torque, so that no unit of length takes part.
    """
    robot = term.robot
    motion = random_motion(robot, np.random.default_rng(0), 20 + 2 * len(term.columns))
    moves = np.array(moving)[:, None]
    motion = replace(motion, q=np.where(moves, motion.q, motion.q[:, :1]), v=moves * motion.v, a=moves * motion.a)
    regressor = np.where(moves[:, None], term.regressor(motion), 0.0)
    size = np.sqrt(np.sum(regressor**2, axis=(0, 2)))
    regressor = regressor / np.where(size > 0.0, size, 1.0)[:, None]
    value = np.random.default_rng(1).uniform(0.5, 1.5, len(size))
    torque = np.einsum("jpn,p->jn", regressor, value)
    usual = np.sqrt(np.mean(torque**2, axis=1))[:, None]
    scaled = rows_by_sample(regressor / np.where(usual > 0.0, usual, 1.0)[:, None])
    alone = rows_by_sample(np.eye(robot.n)[:, :, None] * (torque / np.where(usual > 0.0, usual, 1.0))[:, None])
    alone = alone / np.where(np.any(alone, axis=0), np.linalg.norm(alone, axis=0), 1.0)
    length = np.linalg.norm(scaled, axis=0)
    left, singular, _ = np.linalg.svd(scaled / np.where(length > 0.0, length, 1.0), full_matrices=False)
    basis = left[:, singular > ROUNDING * singular[0]]
    outside = alone - basis @ (basis.T @ alone)
    share = np.linalg.norm(outside, axis=0)
    determined = np.flatnonzero(share**2 >= ABSORBED_SHARE)
    _, singular, right = np.linalg.svd(outside[:, determined] / share[determined], full_matrices=False)
    null = right[singular <= ROUNDING * max(singular, default=0.0)]
    common = null.T @ null
    groups = [(j,) for j in range(robot.n) if j not in determined]
    for place, j in enumerate(determined):
        own = np.abs(common[place]) > SAME_GROUP_SHARE * np.sqrt(common[place, place] * np.diag(common))
        own[place] = True
        if determined[own][:1].tolist() == [j]:
            groups.append(tuple(determined[own].tolist()))
    return tuple(sorted(groups))
