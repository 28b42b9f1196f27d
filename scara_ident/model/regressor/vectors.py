"""Vectors of three recorded expressions or numbers."""

from __future__ import annotations

from collections.abc import Iterable

from scara_ident.arrays import Array
from scara_ident.model.regressor.tracing import Scalar

Vector = tuple[Scalar, Scalar, Scalar]
ZERO: Vector = (0.0, 0.0, 0.0)


def vector(values: Iterable[Scalar]) -> Vector:
    """Return the vector of three values."""
    x, y, z = values
    return x, y, z


def floats(values: Array) -> Vector:
    """Return the vector of an array of three numbers."""
    return vector(float(value) for value in values)


def dot(x: Vector, y: Vector) -> Scalar:
    """Return the inner product."""
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


def plus(x: Vector, y: Vector) -> Vector:
    """Return the sum."""
    return x[0] + y[0], x[1] + y[1], x[2] + y[2]


def scaled(x: Vector, factor: Scalar) -> Vector:
    """Return a multiple."""
    return x[0] * factor, x[1] * factor, x[2] * factor


def cross(x: Vector, y: Vector) -> Vector:
    """Return the cross product."""
    return x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]
