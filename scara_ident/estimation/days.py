"""Which recordings are of one day, by the zeros of their torque sensors, and the freedom of so few days."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array

# Of days whose runs are all of one so few have two that lie further apart, by chance.
SAME_DAY_LEVEL = 0.01
# Of two draws of their own so many lie so near each other by chance.
DIFFERENT_DAYS_LEVEL = 0.05


def same_day(offsets: Array, unsure: Array, std: Array) -> NDArray[np.intp] | None:
    """Return which runs share their offsets on all joints.

    The zero of a sensor is of the day, and the runs of two days tell but two draws of it, however many they are. Days are
    clusters in which any two runs lie no further apart than their uncertainty leaves them, or nearer than draws of their
    own would (complete linkage; chi-squared): what a run's friction does looks like an offset, too.

    Parameters
    ----------
    offsets : ndarray, shape (n, runs)
        By how much each run lies off the mean on each joint.
    unsure : ndarray, shape (n, runs)
        The variance of that.
    std : ndarray, shape (n,)
        Standard deviation between runs.

    Returns
    -------
    ndarray of int, shape (runs,), or None
        The day of each, from 1 on; None where all are of one, or no two.
    """
    joints, runs = offsets.shape
    if runs < 3:
        return None
    from scipy.cluster.hierarchy import fcluster, linkage
    from scipy.special import chdtri

    first, second = np.triu_indices(runs, 1)
    chance = float(chdtri(joints, SAME_DAY_LEVEL / len(first))) * (unsure[:, first] + unsure[:, second])
    near = float(chdtri(joints, 1.0 - DIFFERENT_DAYS_LEVEL)) * 2.0 * std[:, None] ** 2
    apart = np.sum((offsets[:, first] - offsets[:, second]) ** 2 / (chance + near), axis=0)
    day = fcluster(linkage(apart, "complete"), 1.0, "distance").astype(np.intp)
    return day if 1 < day.max() < runs else None
