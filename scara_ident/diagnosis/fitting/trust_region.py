"""Trust-region least squares with limits on each parameter: the linearisation holds only near its point.

The multiplier that keeps a step within a radius is that of Moré (Lecture Notes in Mathematics 630, 1978): what the column of a parameter
makes, and not its unit, says how far it goes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.arrays import Array

# Directions whose singular value, columns scaled to unit length, is below this share of the largest take no step.
STEPLESS = 1e-9
# A step is as long as it may be to this share, which no fit notices.
RADIUS_TOLERANCE = 0.1
# Multipliers between which one is looked for: below the least nothing is held back, above the most nothing moves.
MIN_MULTIPLIER, MAX_MULTIPLIER = 1e-10, 1e6


def least_squares(columns: Array, target: Array) -> tuple[Array, Array, Array]:
    """Return the least squares of rows, columns scaled to unit length.

    Parameters
    ----------
    columns : ndarray, shape (m, s)
    target : ndarray, shape (m,)

    Returns
    -------
    value : ndarray, shape (s,)
        0 where a column is.
    root : ndarray, shape (s, r)
        Its product with its transpose is the covariance for rows of unit noise.
    basis : ndarray, shape (m, r)
        Orthonormal, of what the columns reach.
    """
    size = np.linalg.norm(columns, axis=0)
    size[size == 0.0] = 1.0
    left, singular, right = np.linalg.svd(columns / size, full_matrices=False)
    kept = singular > STEPLESS * np.max(singular, initial=0.0)
    root = right[kept].T / singular[kept] / size[:, None]
    return root @ (left[:, kept].T @ target), root, left[:, kept]


def within_room(columns: Array, target: Array, rooms: Sequence[tuple[float, float]]) -> Array:
    """Return the least squares with each parameter in its room, shape (s,).

    Parameters
    ----------
    columns : ndarray, shape (m, s)
    target : ndarray, shape (m,)
    rooms : sequence of (float, float), s of them
        Least and largest value of each parameter.
    """
    low, high = np.array(rooms, dtype=float).reshape(-1, 2).T
    value = least_squares(columns, target)[0]
    if np.all((low <= value) & (value <= high)):
        return value
    # Imported where it is needed, as most steps stay inside.
    from scipy.optimize import lsq_linear

    size = np.linalg.norm(columns, axis=0)
    free = (low < high) & (size > 0.0)
    value = np.clip(np.zeros(len(low)), low, high)
    if np.any(free):
        rows = columns[:, free] / size[free]
        left = target - columns[:, ~free] @ value[~free]
        found = lsq_linear(rows, left, (low[free] * size[free], high[free] * size[free]), method="bvls").x
        value[free] = np.clip(found / size[free], low[free], high[free])
    return value


def within_radius(columns: Array, target: Array, rooms: Sequence[tuple[float, float]], radius: float) -> Array:
    """Return the same, all parameters together no longer than a radius: each times the length of its column.

    Parameters
    ----------
    radius : float
        Kept to a tenth of it.
    """
    found = within_room(columns, target, rooms)
    if not length(columns, found) > (1.0 + RADIUS_TOLERANCE) * radius:
        return found
    size, none = np.diag(np.linalg.norm(columns, axis=0)), np.zeros(columns.shape[1])
    low, high = np.log(MIN_MULTIPLIER), np.log(MAX_MULTIPLIER)
    while high - low > RADIUS_TOLERANCE:
        middle = 0.5 * (low + high)
        rows = np.vstack([columns, np.exp(0.5 * middle) * size])
        found = within_room(rows, np.append(target, none), rooms)
        own = length(columns, found)
        if abs(own - radius) <= RADIUS_TOLERANCE * radius:
            break
        low, high = (middle, high) if own > radius else (low, middle)
    return found


def length(columns: Array, value: Array) -> float:
    """Return the length of parameters, each times that of its column."""
    return float(np.linalg.norm(np.linalg.norm(columns, axis=0) * value))
