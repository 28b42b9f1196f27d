"""The nominal arm as prior: as a quadratic penalty with the data, and where the data determine nothing.

The distance between bodies is the entropic divergence of their pseudo-inertias (Lee, Wensing, Park 2020, "Geometric
robot dynamic identification: a convex programming approach")

    D(P | P0) = tr(P0^-1 P) - log det(P0^-1 P) - 4,

which depends on neither frame nor unit and is infinite for a body that cannot exist. Each rotor has the same
divergence of numbers, a/a0 - log(a/a0) - 1, times a weight that is small where a0 is a guess.

**Prior weight.** Near the nominal arm the divergence is half the squared length of the bodies' difference from nominal,
as matrices relative to nominal. In that length every direction has a standard deviation s that the data leave it, and
an estimated distance z from nominal. A prior of weight w moves the estimate by w s z of its standard deviations. The
weight is therefore

- as given where z is within a few standard deviations of zero: it keeps poorly determined directions from following
  the noise;
- reduced where it is not, so that the estimate moves by no more than a twentieth of its standard deviation, however
  wrong the nominal body is.

**Undetermined directions.** Among all bodies with the same base parameters the divergence has one minimum. It is found
by Newton's method, which converges for such a self-concordant function (Nesterov, Nemirovskii 1994).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import EstimationError
from scara_ident.estimation.consistent.bodies import PACKED_IDENTITY, unpack
from scara_ident.estimation.consistent.constraints import Cone
from scara_ident.estimation.consistent.friction import torque_unit
from scara_ident.estimation.consistent.problem import Unknowns
from scara_ident.model.terms import Offset

# The data distinguish a direction from nominal at this many standard deviations; then the prior moves it by this share
# of one.
SIGNIFICANT_STDS = 4.0
MAX_BIAS = 0.05
# No arm differs from its nominal one by more than this factor; a larger standard deviation distinguishes nothing.
MAX_NOMINAL_FACTOR = 1e5
# What is constant is rather this share of the torque.
OFFSET_SHARE = 0.1
# Singular values below this share of the largest are made of rounding.
ROUNDING = 1e-12

# Newton's method stops when the divergence is known to this, relative to itself where it is large.
PRECISION = 1e-10
# A start that is far heavier than nominal approaches it by lighter and lighter nominal arms, each this factor lighter,
# and each reached to a rough precision only.
CONTINUATION_FACTOR = 4.0
CONTINUATION_PRECISION = 1e-2
MAX_STEPS = 100
LINE_STEPS = 12
# Weights of the logarithmic barrier of limits; the last is too small to move anything.
BARRIER = (1.0, 1e-2, 1e-4, 1e-6, 1e-8)


def prior_rows(u: Unknowns, rows: Array, target: Array, weight: float) -> Array:
    """Return the rows of the prior's quadratic form.

    Parameters
    ----------
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
    scales[10 * u.n : 11 * u.n] = 1.0 / np.sqrt(u.nominal.rotor_weights)
    scales[11 * u.n :] = _other_scales(u, rows, target)
    scaled = rows * scales
    left, singular, right = np.linalg.svd(scaled, full_matrices=False)
    # Distance from nominal in standard deviations, z / s, with s = 1 / singular.
    apart = np.abs(left.T @ (target - rows @ u.reference))
    significant = (
        (apart > SIGNIFICANT_STDS) & (singular * MAX_NOMINAL_FACTOR > 1.0) & (singular > ROUNDING * singular[0])
    )
    reduced = np.minimum(weight, MAX_BIAS * singular[significant] ** 2 / apart[significant])
    directions = right[significant]
    form = np.sqrt(weight) * np.eye(u.size)
    form += directions.T @ ((np.sqrt(reduced) - np.sqrt(weight))[:, None] * directions)
    return np.asarray(form / scales)


def _other_scales(u: Unknowns, rows: Array, target: Array) -> Array:
    """Size of the other columns' unknowns: their torque limit's, or that at which one makes the whole torque.

    A constant torque, beside which a vertical axis does not tell its mass, is rather a tenth of it.
    """
    size = np.linalg.norm(rows[:, 11 * u.n :], axis=0)
    torque = float(np.linalg.norm(target))
    scales = np.where(size > 0.0, torque / np.where(size > 0.0, size, 1.0), 1.0)
    column = np.argmax(u.to_parameters[:, 11 * u.n :] != 0.0, axis=0)
    for polynomial in u.polynomials:
        if np.isfinite(polynomial.limit) and np.isfinite(polynomial.speed):
            scales[np.isin(column, polynomial.columns)] = polynomial.limit / torque_unit(polynomial)
    for term in u.model.terms:
        if isinstance(term, Offset):
            place = u.model.place(term)
            scales[(column >= place.start) & (column < place.stop)] *= OFFSET_SHARE
    return np.where(scales > 0.0, scales, 1.0)


def divergence(x: Array, weight: float = 1.0, rotors: Array | float = 1.0) -> float:
    """Return the divergence of bodies and rotors relative to nominal, shape (11 n,), from the nominal arm.

    With ``weight`` on the traces the nominal arm is 1/weight times as heavy, and the result differs by a constant.
    ``rotors`` are the weights of the rotors' divergences, shape (n,).
    """
    n = len(x) // 11
    bodies = np.linalg.eigvalsh(unpack(x[: 10 * n].reshape(n, 10)))
    values = np.concatenate([bodies.ravel(), x[10 * n :]])
    if np.any(values <= 0.0):
        return np.inf
    return float(_each(n, rotors) @ (weight * values - np.log(values) - 1.0))


def _each(n: int, rotors: Array | float) -> Array:
    """Return the weights of the four eigenvalues of every body, and of the rotors."""
    return np.append(np.ones(4 * n), np.broadcast_to(rotors, n))


def nearest_to_nominal(start: Array, free: Array, limits: Sequence[Cone] = (), rotors: Array | float = 1.0) -> Array:
    """Find the bodies nearest to nominal along free directions.

    This is not left to cvxpy: Clarabel with ``log_det`` takes 85 ms on the arm of UR5 and 33 ms on SCARA03, where these
    steps take 10 and 3, and leaves errors of up to 7e-4 of the nominal bodies.

    Parameters
    ----------
    start : ndarray, shape (11 n,)
        Bodies and rotors relative to nominal (see `Unknowns`), strictly possible and strictly within the limits.
    free : ndarray, shape (11 n, k)
        Directions along which nothing changes that torque depends on.
    limits : sequence of Cone, optional
        Bounds of masses and centres of mass, on the 11 n unknowns.
    rotors : ndarray, shape (n,), optional
        Weights of the rotors' divergences.

    Returns
    -------
    ndarray, shape (11 n,)

    Raises
    ------
    EstimationError
        If Newton's method does not converge.
    """
    if free.shape[1] == 0:
        return start
    weights = BARRIER if limits else (0.0,)
    n = len(start) // 11
    x = start
    # The share of its weight at which the nominal arm is as heavy as the start.
    heavy = 5.0 * n / max(5.0 * n, float(np.tile(PACKED_IDENTITY, n) @ start[: 10 * n] + start[10 * n :].sum()))
    while heavy < 1.0:
        x = _newton(x, free, _Cost(limits, rotors, weights[0], heavy), CONTINUATION_PRECISION)
        heavy *= CONTINUATION_FACTOR
    for weight in weights:
        x = _newton(x, free, _Cost(limits, rotors, weight, 1.0), PRECISION)
    return x


def _newton(start: Array, free: Array, cost: _Cost, precision: float) -> Array:
    n = len(start) // 11
    directions = unpack(np.moveaxis(free[: 10 * n].reshape(n, 10, -1), 2, 1))
    x, value = start, cost.value(start)
    for _ in range(MAX_STEPS):
        gradient, root, local = cost.slopes(x, directions, free)
        triangular = np.asarray(np.linalg.qr(root, mode="r"))
        half = np.linalg.solve(triangular.T, gradient)
        step = -np.linalg.solve(triangular, half)
        decrement = float(half @ half)
        change = free @ step
        if decrement < precision * max(1.0, abs(value)):
            # The last step squares what error is left, and too little is gained to measure it.
            return x + change if np.isfinite(cost.value(x + change)) else x
        length = 1.0 if cost.weight else cost.length(np.tensordot(local, step, axes=(1, 0)), change, x)
        while True:
            trial = x + length * change
            new = cost.value(trial)
            if new < value:
                break
            length *= 0.5
            if length < 1e-12:
                raise EstimationError(
                    "the bodies nearest to the nominal ones were not found: the URDF's inertias and the data are too "
                    "far apart; correct the URDF or give link_mass"
                )
        x, value = trial, new
    raise EstimationError(
        f"the bodies nearest to the nominal ones were not found in {MAX_STEPS} steps; correct the URDF's inertias"
    )


@dataclass(frozen=True, eq=False)
class _Cost:
    """The divergence from nominal, whose linear part counts ``heavy`` times, and a barrier of a weight at the limits."""

    limits: Sequence[Cone]
    rotors: Array | float
    weight: float
    heavy: float

    def value(self, x: Array) -> float:
        """Return the cost of bodies; infinite where they are none, or beyond a limit."""
        value = divergence(x, self.heavy, self.rotors)
        if self.weight == 0.0 or not np.isfinite(value):
            return value
        for limit in self.limits:
            if not limit.margin(x) > 0.0:
                return np.inf
            distances = limit(x) if limit.kind == "nonnegative" else _LORENTZ @ limit(x) ** 2
            value -= self.weight * float(np.sum(np.log(distances)))
        return value

    def slopes(self, x: Array, directions: Array, free: Array) -> tuple[Array, Array, Array]:
        """Return the gradient along the free directions, a square root of the Hessian as rows, and the directions seen from x."""
        n = len(directions)
        inverse_root = np.linalg.inv(np.linalg.cholesky(unpack(x[: 10 * n].reshape(n, 10))))
        # In the metric of the point itself, each direction is a symmetric matrix per body.
        local = inverse_root[:, None] @ directions @ np.swapaxes(inverse_root, 1, 2)[:, None]
        weights = _each(n, self.rotors)[4 * n :]
        own = free[10 * n :] / x[10 * n :, None]
        trace = np.trace(local, axis1=2, axis2=3)
        linear = np.tile(PACKED_IDENTITY, n) @ free[: 10 * n] + weights @ free[10 * n :]
        gradient = self.heavy * linear - trace.sum(axis=0) - weights @ own
        count = free.shape[1]
        rows = [np.moveaxis(local, 1, 3).reshape(16 * n, count), np.sqrt(weights)[:, None] * own]
        for limit in self.limits:
            slope, root_of_hessian = _barrier(limit, x)
            gradient = gradient + self.weight * (slope @ limit.matrix @ free)
            rows.append(np.sqrt(self.weight) * (root_of_hessian @ limit.matrix @ free))
        return gradient, np.vstack(rows), local

    def length(self, local: Array, change: Array, x: Array) -> float:
        """Return the length of the step that makes the divergence smallest along it.

        Near the edge Newton's own length only doubles the distance from it; along a line the divergence is a sum of
        logarithms, and its best length is the root of a rising function. Limits are not seen.
        """
        n = len(local)
        rates = np.concatenate([np.linalg.eigvalsh(local).ravel(), change[10 * n :] / x[10 * n :]])
        each = _each(n, self.rotors)
        linear = self.heavy * float(np.tile(PACKED_IDENTITY, n) @ change[: 10 * n] + each[4 * n :] @ change[10 * n :])
        fastest = float(np.min(rates))
        low, high = 0.0, (1.0 / -fastest if fastest < 0.0 else 1e12)
        length = min(1.0, 0.5 * high)
        for _ in range(LINE_STEPS):
            share = rates / (1.0 + length * rates)
            slope = linear - float(each @ share)
            if slope > 0.0:
                high = length
            else:
                low = length
            trial = length - slope / max(float(each @ share**2), np.finfo(float).tiny)
            # Newton along the line where it stays between the bounds, their middle in ratio where not.
            length = trial if low < trial < high else (np.sqrt(low * high) if low > 0.0 else 0.1 * high)
        return float(length)


_LORENTZ = np.array([1.0, -1.0, -1.0, -1.0])


def _barrier(limit: Cone, x: Array) -> tuple[Array, Array]:
    """Gradient and a root of the Hessian of minus the logarithm of a limit's slack, in its own values."""
    value = limit(x)
    if limit.kind == "nonnegative":
        return -1.0 / value, np.diag(1.0 / value)
    distance = float(_LORENTZ @ value**2)
    slope = -2.0 / distance * (_LORENTZ * value)
    hessian = np.outer(slope, slope) - 2.0 / distance * np.diag(_LORENTZ)
    return slope, np.asarray(np.linalg.cholesky(hessian).T)
