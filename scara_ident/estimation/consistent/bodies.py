"""Rigid bodies as pseudo-inertia matrices, and the standard parameters as linear maps of them.

A body can exist if and only if its 4x4 pseudo-inertia is positive semidefinite (Wensing, Kim, Slotine 2018):

    P = [[S, h], [h.T, m]]   with   S = tr(I)/2 - I,   h = m c,

the second moments, first moments and mass of its density. Here every body is written relative to its nominal one,
``P = C Q C.T`` with ``P0 = C C.T``: Q is the identity at the nominal body, has no unit, and a change of frame or of
units multiplies P and P0 alike and leaves Q as it is up to a rotation. What is said of Q is therefore invariant.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.model.base_parameters import pseudo_inertia


@cache
def _entries(size: int) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Rows and columns of the upper triangle column by column, as Clarabel packs it, and the weight of each entry."""
    columns, rows = np.tril_indices(size)
    # Off-diagonal entries weigh sqrt(2), so that packed vectors have the inner product of the matrices.
    return rows, columns, np.where(rows == columns, 1.0, np.sqrt(2.0))


def pack(matrix: Array) -> Array:
    """Pack symmetric matrices, shape (..., k, k), into vectors, shape (..., k (k + 1) / 2), keeping the inner product."""
    rows, columns, weight = _entries(matrix.shape[-1])
    return np.asarray(matrix[..., rows, columns] * weight)


def unpack(vector: Array) -> Array:
    """Undo `pack`: vectors, shape (..., k (k + 1) / 2), to symmetric matrices, shape (..., k, k)."""
    size = int(np.sqrt(2 * vector.shape[-1]))
    rows, columns, weight = _entries(size)
    matrix = np.zeros((*vector.shape[:-1], size, size))
    matrix[..., rows, columns] = vector / weight
    matrix[..., columns, rows] = vector / weight
    return matrix


def unpacking(length: int = 10) -> Array:
    """Return the constant matrix, shape (k^2, length), that takes a packed vector to its matrix row by row."""
    return unpack(np.eye(length)).reshape(length, -1).T


PACKED_IDENTITY = pack(np.eye(4))
"""The nominal body relative to itself, shape (10,)."""


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
    x, y, z = np.asarray(body.lever).tolist()
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = np.asarray(body.inertia).tolist()
    return LinkInertia(name, float(body.mass), (x, y, z), (xx, xy, xz, yy, yz, zz))
