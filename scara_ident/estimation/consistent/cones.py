"""Convex constraints as data: rows of affine functions and the cone each of them must lie in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Affine:
    """Affine functions ``matrix @ x + offset`` of the same unknowns.

    Attributes
    ----------
    matrix : ndarray, shape (k, unknowns)
    offset : ndarray, shape (k,)
    """

    matrix: Array
    offset: Array

    def __call__(self, x: Array) -> Array:
        """Evaluate at a point, shape (k,)."""
        return np.asarray(self.matrix @ x + self.offset)

    def __len__(self) -> int:
        """Return the number of functions."""
        return len(self.offset)

    def at(self, places: Sequence[int] | NDArray[np.intp], unknowns: int) -> Affine:
        """Return the same functions of a longer vector in which these unknowns stand at ``places``."""
        wide = np.zeros((len(self), unknowns))
        wide[:, places] = self.matrix
        return Affine(wide, self.offset)

    def widened(self, unknowns: int) -> Affine:
        """Return the same functions of a longer vector whose further unknowns they do not see."""
        return self.at(np.arange(self.matrix.shape[1]), unknowns)

    @staticmethod
    def none(unknowns: int) -> Affine:
        """Return no function."""
        return Affine(np.zeros((0, unknowns)), np.zeros(0))

    @staticmethod
    def stacked(parts: Sequence[Affine], unknowns: int) -> Affine:
        """Put affine functions of the same unknowns on top of each other."""
        if not parts:
            return Affine.none(unknowns)
        return Affine(np.vstack([p.matrix for p in parts]), np.concatenate([p.offset for p in parts]))


@dataclass(frozen=True, eq=False)
class Cones:
    """Constraints on the same unknowns.

    Attributes
    ----------
    nonnegative : Affine
        Each function is at least 0.
    small : Affine
        Three functions (d, e, f) after three: the 2x2 matrix [[d, e], [e, f]] is positive semidefinite.
    ball : Affine
        Four functions (t, u) after four: the length of u is at most t.
    """

    nonnegative: Affine
    small: Affine
    ball: Affine

    def at(self, places: Sequence[int] | NDArray[np.intp], unknowns: int) -> Cones:
        """Return the same constraints on a longer vector in which these unknowns stand at ``places``."""
        return Cones(*(part.at(places, unknowns) for part in (self.nonnegative, self.small, self.ball)))

    @staticmethod
    def stacked(parts: Sequence[Cones], unknowns: int) -> Cones:
        """Collect constraints on the same unknowns."""
        return Cones(
            Affine.stacked([p.nonnegative for p in parts], unknowns),
            Affine.stacked([p.small for p in parts], unknowns),
            Affine.stacked([p.ball for p in parts], unknowns),
        )

    @staticmethod
    def linear(nonnegative: Affine) -> Cones:
        """Return constraints that are only inequalities."""
        unknowns = nonnegative.matrix.shape[1]
        return Cones(nonnegative, Affine.none(unknowns), Affine.none(unknowns))
