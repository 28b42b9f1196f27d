"""Columns that are finite: rows of an effect that divides by zero or overflows say nothing about the arm."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from scara_ident.arrays import Array

# No column of a torque is larger, in any unit; squares of products of larger ones overflow.
MAX_COLUMN = 1e60


def is_finite(columns: Array) -> bool:
    """Whether all of some columns are numbers that fits can take."""
    # Not so either where the largest is NaN. Without a copy of their sizes, for each column is looked at.
    return bool(columns.max(initial=0.0) <= MAX_COLUMN and columns.min(initial=0.0) >= -MAX_COLUMN)


def finite_or_zero(columns: Array) -> Array:
    """Return columns, shape (..., k, N), zero those that are not finite somewhere."""
    if is_finite(columns):
        return columns
    held = np.max(np.abs(columns), axis=-1, keepdims=True, initial=0.0) <= MAX_COLUMN
    return np.where(held, columns, 0.0)


def torque_slope(
    value: Array, middle: Mapping[int, Array], sides: Sequence[Mapping[int, Array]], reach: float
) -> dict[int, Array]:
    """Return the derivative of what coefficients (k,) do to each joint's torque, shape (N,), by the difference of two sides.

    Parameters
    ----------
    middle : mapping of int to ndarray, shape (k, N)
        Columns on every joint that they act on.
    sides : sequence of mapping, two
        Columns above and below, as far away as ``reach``. Where those of one are zero, as what is not finite is, the other says
        it beside the middle.
    """
    there = [any(np.any(rows) for rows in side.values()) for side in sides]
    up, down = (side if some else middle for side, some in zip(sides, there, strict=True))
    width = reach * max(1, sum(there))
    return {joint: np.asarray(value @ (up[joint] - down[joint]) / width) for joint in middle}
