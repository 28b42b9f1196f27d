"""Small matrices at every sample: their products, their inverses, and mass matrices that a poor estimate leaves nearly singular."""

from __future__ import annotations

import numpy as np

from scara_ident.arrays import Array

# The links' mass matrix, scaled to a diagonal of 1, has no smaller eigenvalue, however poor the estimate.
MIN_EIGENVALUE = 0.01


def times(matrices: Array, rows: Array, result: Array | None = None) -> Array:
    """Return the products of matrices (m, m, N) with vectors (..., m, M) at the first M samples, in a place for them if one is given."""
    count, m = rows.shape[-1], len(matrices)
    result = np.empty(rows.shape) if result is None else result
    for a in range(m):
        own = result[..., a, :]
        np.multiply(matrices[a, 0, :count], rows[..., 0, :], out=own)
        for b in range(1, m):
            own += matrices[a, b, :count] * rows[..., b, :]
    return result


def inverse(matrices: Array) -> Array:
    """Return the inverses of matrices (m, m, N)."""
    if len(matrices) == 1:
        return np.asarray(1.0 / matrices)
    if len(matrices) == 2:
        # A twentieth of the time that a general solver takes for matrix after matrix.
        (a, b), (c, d) = matrices
        return np.asarray(np.array([[d, -b], [-c, a]]) / (a * d - b * c))
    if len(matrices) == 3:
        # Rows of the inverse are cross products of columns, over the determinant.
        rows = np.empty(matrices.shape)
        for k in range(3):
            (a, b, c), (d, e, f) = matrices[:, (k + 1) % 3], matrices[:, (k + 2) % 3]
            rows[k] = b * f - c * e, c * d - a * f, a * e - b * d
        rows /= matrices[0, 0] * rows[0, 0] + matrices[1, 0] * rows[0, 1] + matrices[2, 0] * rows[0, 2]
        return rows
    return np.ascontiguousarray(np.moveaxis(np.linalg.inv(np.moveaxis(matrices, 2, 0)), 0, 2))


def definite(inertia: Array) -> Array:
    """Return mass matrices (m, m, N) that are positive definite, their diagonals as they are."""
    if len(inertia) == 1:
        return inertia
    size = np.sqrt(np.einsum("iin->in", inertia))
    scaled = inertia / (size[:, None] * size)
    least = _min_eigenvalues(scaled)
    factor = np.where(least < MIN_EIGENVALUE, (1.0 - MIN_EIGENVALUE) / (1.0 - np.minimum(least, 0.5)), 1.0)
    result = inertia * factor
    for a in range(len(inertia)):
        result[a, a] = inertia[a, a]
    return np.asarray(result)


def _min_eigenvalues(scaled: Array) -> Array:
    """Return the smallest eigenvalues, shape (N,), of symmetric matrices (m, m, N) with a diagonal of 1; 1 for those above `MIN_EIGENVALUE`."""
    if len(scaled) == 2:
        # What the two share lies beside the diagonal.
        return np.asarray(1.0 - np.abs(scaled[1, 0]))
    # That all pivots are positive takes a tenth of the time of the eigenvalues, which few matrices need.
    left, low = scaled.copy(), np.zeros(scaled.shape[2], dtype=bool)
    for a in range(len(left)):
        left[a, a] -= MIN_EIGENVALUE
    for a in range(len(left)):
        low |= ~(left[a, a] > 0.0)
        pivot = np.where(low, 1.0, left[a, a])
        for b in range(a + 1, len(left)):
            left[b, a + 1 :] -= left[b, a] / pivot * left[a, a + 1 :]
    result = np.ones(scaled.shape[2])
    if np.any(low):
        result[low] = np.linalg.eigvalsh(np.moveaxis(scaled[..., low], 2, 0))[:, 0]
    return result
