"""Rows of positions, velocities, accelerations and torques as they are given, one of each joint at every sample."""

from __future__ import annotations

import numpy as np

from scara_ident.arrays import Array
from scara_ident.model.model import TorqueModel
from scara_ident.motion.motion import Motion


def rows_of_samples(
    model: TorqueModel, signals: Array, rest: Array, weight: Array, rate: float
) -> tuple[list[Array], Array]:
    """Return each joint's rows ``[W | u]`` at every sample, shape (N, k + 1), and how many of them count, shape (n,).

    Parameters
    ----------
    signals : ndarray, shape (N, 4, n)
        Position, velocity, acceleration and torque.
    rest : ndarray, shape (n,)
        Speed up to which a joint counts as at rest: its rows are zero there.
    weight : ndarray, shape (n,)
        Of each joint's torque.
    rate : float
        Samples per second.
    """
    q, v, a, effort = np.ascontiguousarray(signals.transpose(1, 2, 0))
    motion = Motion("online", "online", np.arange(float(len(signals))), q, v, a, None, rate)
    tables = [np.empty((len(own) + 1, len(signals))) for own in model.active]
    model.joint_columns(motion, [table[:-1] for table in tables])
    moving = np.abs(v) > rest[:, None]
    for table, torque, moves, size in zip(tables, effort, moving, weight, strict=True):
        table[-1] = torque
        table *= np.where(moves, size, 0.0)
    return [table.T for table in tables], np.count_nonzero(moving, axis=1)
