"""How the prior pulls where the data leave a choice.

Near the nominal arm the entropic divergence (see `scara_ident.estimation.consistent.prior`) is half the squared length of the
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

from scara_ident.estimation.consistent.unknowns import Unknowns

Array = NDArray[np.float64]

# The data tell a direction from nominal at this many standard deviations; then the prior moves it by this share of one.
TOLD_APART = 4.0
MOST_BIAS = 0.05
# No arm differs from its nominal one by more than this; directions of a larger standard deviation tell nothing.
FARTHEST = 1e5
# Singular values below this share of the largest are made of rounding.
ROUNDING = 1e-12


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
    left, singular, right = np.linalg.svd(scaled, full_matrices=False)
    # Distance from nominal in standard deviations, z / s, with s = 1 / singular.
    apart = np.abs(left.T @ (target - rows @ u.reference))
    told = (apart > TOLD_APART) & (singular * FARTHEST > 1.0) & (singular > ROUNDING * singular[0])
    reduced = np.minimum(weight, MOST_BIAS * singular[told] ** 2 / apart[told])
    directions = right[told]
    form = np.sqrt(weight) * np.eye(u.size)
    form += directions.T @ ((np.sqrt(reduced) - np.sqrt(weight))[:, None] * directions)
    return np.asarray(form / scales)


def _other_scales(u: Unknowns, rows: Array, target: Array) -> Array:
    """Size of the other columns' unknowns: their torque limit's, or that at which one makes the whole torque."""
    size = np.linalg.norm(rows[:, 11 * u.n :], axis=0)
    torque = float(np.linalg.norm(target))
    scales = np.where(size > 0.0, torque / np.where(size > 0.0, size, 1.0), 1.0)
    column = np.argmax(u.to_parameters[:, 11 * u.n :] != 0.0, axis=0)
    scales[np.isin(column, u.bounded)] = 1.0
    return np.where(scales > 0.0, scales, 1.0)
