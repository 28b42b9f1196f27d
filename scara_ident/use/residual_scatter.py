"""The scatter of the external torque without contact, by what the joints do: the uncertainty of a force estimated from it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.use.alarm import MIN_SCALE, in_windows, made_of
from scara_ident.use.external_torque import Observed


@dataclass(frozen=True, eq=False)
class ResidualScatter:
    """Second moments of the residual without contact.

    Attributes
    ----------
    squares : ndarray, shape (n, k)
        Mean square of each joint's residual per square of each feature, (N m)^2 or N^2.
    least : ndarray, shape (n,)
        Least mean square.
    correlation : ndarray, shape (n, n)
        Of the joints' residuals, each over its root mean square in its state.
    """

    squares: Array
    least: Array
    correlation: Array

    def covariance(self, features: Array) -> Array:
        """Return the second moments of the residual where features are (n, k), shape (n, n)."""
        size = np.sqrt(_mean_squares(self.squares, self.least, features[:, :, None])[:, 0])
        return np.asarray(size[:, None] * self.correlation * size)


def residual_scatter(runs: Sequence[Observed]) -> ResidualScatter:
    """Return how much the residual of recordings without contact scatters.

    Mean squares in windows are fitted by squares of the features' means with coefficients that are not negative: a joint at rest
    has another residual than one that moves.
    """
    _, square, features = in_windows(runs)
    squares = made_of(square, features**2)
    least = MIN_SCALE**2 * np.maximum(np.mean(square, axis=1), 1e-24)
    products = np.zeros((len(least), len(least)))
    for run in runs:
        size = np.sqrt(_mean_squares(squares, least, run.features[:, :, run.settled]))
        z = run.torque[:, run.settled] / size
        products += z @ z.T
    size = np.sqrt(np.maximum(np.diag(products), np.finfo(float).tiny))
    return ResidualScatter(squares, least, products / size[:, None] / size)


def _mean_squares(squares: Array, least: Array, features: Array) -> Array:
    """Return the usual mean square of the residual, shape (n, N)."""
    return np.asarray(np.maximum(np.einsum("jk,jkn->jn", squares, features**2), least[:, None]))
