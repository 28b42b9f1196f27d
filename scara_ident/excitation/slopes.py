"""How the cost and the limits of a motion change with its coefficients."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array


@dataclass(frozen=True, eq=False)
class Slopes:
    """Cost and limits of a motion with their derivatives by the coefficients.

    A limit is a row ``y`` over all samples that must stay within ``+-bound`` or, if it has one side, below it.

    Attributes
    ----------
    gradient : ndarray, shape (k, n m)
    values : ndarray, shape (R, k M)
        All rows.
    own : tuple of (int, int, float)
        For the first rows, which depend on one joint: derivative (0 position, 1 velocity, ...), joint, scale.
    shared : ndarray, shape (R', k, M, n m)
        Derivative of the rows after them.
    rows : ndarray, shape (4, k, M, m)
        The bases.
    """

    cost: float
    gradient: Array
    values: Array
    own: tuple[tuple[int, int, float], ...]
    shared: Array
    rows: Array

    def pull(self, u: Array) -> Array:
        """Return the transposed derivative of all rows times u (R, k M), shape (k, n m)."""
        k, _, width = self.shared.shape[1:]
        m = self.rows.shape[3]
        u = u.reshape(len(u), k, -1)
        result = (
            np.einsum("rkM,rkMx->kx", u[len(self.own) :], self.shared) if len(self.shared) else np.zeros((k, width))
        )
        for row, (kind, joint, scale) in enumerate(self.own):
            result[:, joint * m : (joint + 1) * m] += scale * np.einsum("kM,kMm->km", u[row], self.rows[kind])
        return np.asarray(result)

    def push(self, x: Array) -> Array:
        """Return the derivative of all rows times x (k, n m), shape (R, k M)."""
        m = self.rows.shape[3]
        own = [
            scale * np.einsum("km,kMm->kM", x[:, j * m : (j + 1) * m], self.rows[kind]) for kind, j, scale in self.own
        ]
        shared = np.einsum("rkMx,kx->rkM", self.shared, x)
        return np.concatenate([np.array(own), shared]).reshape(len(self.values), -1)

    def curvature(self, d: Array) -> Array:
        """Return the squares of all derivatives weighted with d (R, k M), summed over samples, shape (k, n m, n m)."""
        k, _, width = self.shared.shape[1:]
        m = self.rows.shape[3]
        d = d.reshape(len(d), k, -1)
        result = np.zeros((k, width, width))
        for part in range(k):
            for row, (kind, joint, scale) in enumerate(self.own):
                place = slice(joint * m, (joint + 1) * m)
                basis = self.rows[kind, part]
                half = basis * (abs(scale) * np.sqrt(d[row, part]))[:, None]
                result[part, place, place] += half.T @ half
            for row, slope in enumerate(self.shared[:, part]):
                half = slope * np.sqrt(d[len(self.own) + row, part])[:, None]
                result[part] += half.T @ half
        return result
