"""How the prior pulls where the data leave a choice.

Near the nominal arm the entropic divergence (see `scara_ident.consistency.prior`) is half the squared length of the
bodies' difference from nominal, as matrices relative to nominal. In that length every direction has a standard
deviation s that the data leave it, and a distance z from nominal that they ask for, both in units of the nominal
body itself. A prior of weight w moves the direction by w s z of its standard deviations. So the weight is

- as given where the data do not tell the direction from nominal: it keeps what they hardly determine from following
  the noise;
- reduced where they do, so that the direction moves by no more than a twentieth of its standard deviation, however
  wrong the nominal body is.

Lengths and directions depend neither on frame nor on unit.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scara_ident.consistency.unknowns import Unknowns

Array = NDArray[np.float64]

# The data tell a direction from nominal at this many standard deviations.
TOLD_APART = 4.0
# Then it may be moved by this share of one.
MOST_BIAS = 0.05


def prior_rows(u: Unknowns, rows: Array, target: Array, weight: float) -> Array:
    """Return the rows of the prior's quadratic form.

    Parameters
    ----------
    u : Unknowns
    rows : ndarray, shape (r, size)
        Data on x, divided by the noise.
    target : ndarray, shape (r,)
    weight : float
        Cost, in squared standard deviations of the noise, of a rotor that differs from nominal by its own inertia.

    Returns
    -------
    ndarray, shape (size, size)
        Rows W on x less its reference; the prior is ``|W (x - reference)|^2``.
    """
    scales = np.ones(u.size)
    scales[11 * u.n :] = _other_scales(u, rows, target)
    scaled = rows * scales
    precision, directions = np.linalg.eigh(scaled.T @ scaled)
    # Rounding may leave a precision below 0: nothing is known of that direction.
    precision = np.clip(precision, 0.0, None)
    score = directions.T @ (scaled.T @ (target - rows @ u.reference))
    root = np.sqrt(precision)
    # Distance from nominal in standard deviations, z / s, and s z = (z / s) / precision.
    apart = np.abs(score) / np.where(root > 0.0, root, np.inf)
    told = apart > TOLD_APART
    weights = np.full(u.size, weight)
    weights[told] = np.minimum(weight, MOST_BIAS * precision[told] / apart[told])
    return np.asarray(np.sqrt(weights)[:, None] * directions.T / scales)


def _other_scales(u: Unknowns, rows: Array, target: Array) -> Array:
    """Size of the other columns' unknowns: their torque limit's, or that at which one makes the whole torque."""
    size = np.linalg.norm(rows[:, 11 * u.n :], axis=0)
    torque = float(np.linalg.norm(target))
    scales = np.where(size > 0.0, torque / np.where(size > 0.0, size, 1.0), 1.0)
    column = np.argmax(u.to_parameters[:, 11 * u.n :] != 0.0, axis=0)
    scales[np.isin(column, u.bounded)] = 1.0
    return np.where(scales > 0.0, scales, 1.0)
