"""Rigid bodies as pseudo-inertia matrices, and the standard parameters as linear maps of them.

A body can exist if and only if its 4x4 pseudo-inertia is positive semidefinite (Wensing, Kim, Slotine 2018):

    P = [[S, h], [h.T, m]]   with   S = tr(I)/2 - I,   h = m c,

the second moments, first moments and mass of its density. Here every body is written relative to its nominal one,
``P = C Q C.T`` with ``P0 = C C.T``: Q is the identity at the nominal body, has no unit, and a change of frame or of
units multiplies P and P0 alike and leaves Q as it is up to a rotation. What is said of Q is therefore invariant.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from scara_ident.model.base_parameters import pseudo_inertia

Array = NDArray[np.float64]

# Entries of a symmetric 4x4 matrix in the order of its packed form: the upper triangle column by column.
_ROWS = np.array([i for j in range(4) for i in range(j + 1)])
_COLUMNS = np.array([j for j in range(4) for i in range(j + 1)])
# Off-diagonal entries weigh sqrt(2), so that packed vectors have the inner product of the matrices.
_WEIGHT = np.where(_ROWS == _COLUMNS, 1.0, np.sqrt(2.0))
PACKED_IDENTITY = np.where(_ROWS == _COLUMNS, 1.0, 0.0)


def pack(matrix: Array) -> Array:
    """Pack symmetric matrices, shape (..., 4, 4), into vectors, shape (..., 10), keeping the inner product."""
    return np.asarray(matrix[..., _ROWS, _COLUMNS] * _WEIGHT)


def unpack(vector: Array) -> Array:
    """Undo `pack`: vectors, shape (..., 10), to symmetric matrices, shape (..., 4, 4)."""
    matrix = np.zeros((*vector.shape[:-1], 4, 4))
    matrix[..., _ROWS, _COLUMNS] = vector / _WEIGHT
    matrix[..., _COLUMNS, _ROWS] = vector / _WEIGHT
    return matrix


def unpacking() -> Array:
    """Return the constant matrix, shape (16, 10), that takes a packed vector to its matrix row by row."""
    return unpack(np.eye(10)).reshape(10, 16).T


def packed_pseudo_inertia() -> Array:
    """Return the constant matrix, shape (10, 10), that takes a body's ten parameters to its packed pseudo-inertia."""
    return np.array([pack(pseudo_inertia(unit)) for unit in np.eye(10)]).T


@dataclass(frozen=True)
class LinkInertia:
    """Mass, centre of mass and inertia of a link.

    Attributes
    ----------
    name : str
        Link of the URDF; what is fixed or locked to it is part of it.
    mass : float
        kg.
    com : tuple of float
        Centre of mass in the link's frame, m.
    inertia : tuple of float
        ixx, ixy, ixz, iyy, iyz, izz about the centre of mass, link axes, kg m^2.
    """

    name: str
    mass: float
    com: tuple[float, float, float]
    inertia: tuple[float, float, float, float, float, float]


def link_inertia(name: str, parameters: Array) -> LinkInertia:
    """Write a body's ten standard parameters as mass, centre of mass and central inertia."""
    body = pin.Inertia.FromDynamicParameters(np.asarray(parameters, dtype=float))
    centre, about = np.asarray(body.lever), np.asarray(body.inertia)
    return LinkInertia(
        name,
        float(body.mass),
        (float(centre[0]), float(centre[1]), float(centre[2])),
        (
            float(about[0, 0]),
            float(about[0, 1]),
            float(about[0, 2]),
            float(about[1, 1]),
            float(about[1, 2]),
            float(about[2, 2]),
        ),
    )


def smallest_share(bodies: Array) -> float:
    """Return the smallest eigenvalue of bodies relative to nominal, packed one after another, shape (10 n,)."""
    return float(np.min(np.linalg.eigvalsh(unpack(bodies.reshape(-1, 10)))))


def smallest_eigenvalue_share(parameters: Array) -> float:
    """Return the smallest eigenvalue of a body's pseudo-inertia as a share of its trace; below 0 it cannot exist."""
    matrix = pseudo_inertia(parameters)
    trace = float(np.trace(matrix))
    smallest = float(np.linalg.eigvalsh(matrix)[0])
    return smallest / trace if trace > 0.0 else (0.0 if not np.any(matrix) else -np.inf)
