"""How the prior pulls where the data leave a choice.

The entropic divergence D (see `scara_ident.consistency.prior`) pulls a body Q, relative to nominal, with the force
1 - Q^-1: no harder than its weight however much heavier than nominal the body is. A least-squares programme needs a
quadratic form instead. With A near Q,

    tr((Q - 1) A^-1 (Q - 1)) / 2

has that force at Q = A. A is taken from the data: the body that they ask for without constraints, with its eigenvalues
counted from 1 upwards, so that a body lighter than nominal is not pulled harder either. It depends neither on frame
nor on unit.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scara_ident.consistency.bodies import pack, unpack
from scara_ident.consistency.unknowns import Unknowns

Array = NDArray[np.float64]

# The bodies that the data ask for depend on the pull, hardly; so many rounds settle that.
ROUNDS = 3


def prior_rows(u: Unknowns, rows: Array, target: Array, weight: float) -> Array:
    """Return the rows of the prior's quadratic form.

    Parameters
    ----------
    u : Unknowns
    rows : ndarray, shape (r, size)
        Data on x, divided by the noise.
    target : ndarray, shape (r,)
    weight : float
        Cost, in squared standard deviations, of a rotor that differs from nominal by its own inertia.

    Returns
    -------
    ndarray, shape (size, size)
        Rows W on x less its reference; the prior is ``|W (x - reference)|^2``.
    """
    n = u.n
    scales = np.ones(u.size)
    scales[11 * n :] = _other_scales(u, rows, target)
    prior = np.diag(1.0 / scales)
    normal, force = rows.T @ rows, rows.T @ target
    for _ in range(ROUNDS):
        form = weight * prior.T @ prior
        # Scaled to a unit diagonal for the sake of digits; only the size of x is wanted.
        size = np.sqrt(np.diag(normal) + np.diag(form))
        x = np.linalg.solve((normal + form) / np.outer(size, size), (force + form @ u.reference) / size) / size
        for i, body in enumerate(unpack(x[: 10 * n].reshape(n, 10))):
            prior[10 * i : 10 * i + 10, 10 * i : 10 * i + 10] = _metric(body)
        rotors = np.arange(10 * n, 11 * n)
        prior[rotors, rotors] = 1.0 / np.sqrt(np.maximum(np.abs(x[rotors]), 1.0))
    return np.asarray(np.sqrt(weight) * prior)


def _metric(body: Array) -> Array:
    """Rows whose squared length is tr(E A^-1 E) for a packed symmetric E, shape (10, 10)."""
    values, vectors = np.linalg.eigh(body)
    inverse = 1.0 / np.maximum(np.abs(values), 1.0)
    rotated = vectors.T @ unpack(np.eye(10)) @ vectors
    return np.asarray((pack(rotated) * np.sqrt(pack_mean(inverse))).T)


def pack_mean(values: Array) -> Array:
    """Mean of two eigenvalues for every entry of a packed matrix, shape (10,)."""
    mean = 0.5 * (values[:, None] + values[None, :])
    return np.asarray(pack(mean) / pack(np.ones((4, 4))))


def _other_scales(u: Unknowns, rows: Array, target: Array) -> Array:
    """Size of the other columns' unknowns: their torque limit's, or that at which one makes the whole torque."""
    size = np.linalg.norm(rows[:, 11 * u.n :], axis=0)
    torque = float(np.linalg.norm(target))
    scales = np.where(size > 0.0, torque / np.where(size > 0.0, size, 1.0), 1.0)
    column = np.argmax(u.to_parameters[:, 11 * u.n :] != 0.0, axis=0)
    scales[np.isin(column, u.bounded)] = 1.0
    return np.where(scales > 0.0, scales, 1.0)
