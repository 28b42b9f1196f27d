"""The bodies nearest to the nominal ones among all that give the same base parameters.

Near is meant in the entropic divergence of pseudo-inertias (Lee, Wensing, Park 2020, "Geometric robot dynamic
identification: a convex programming approach")

    D(P | P0) = tr(P0^-1 P) - log det(P0^-1 P) - 4,

which knows neither frame nor unit. It is infinite at the edge of what a body can be, so the result is inside. Each
rotor enters with the same divergence of numbers, a/a0 - log(a/a0) - 1. The minimum under linear equations is found by
Newton's method, which for such a function is safe and quick (Nesterov, Nemirovskii 1994).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scara_ident.errors import EstimationError
from scara_ident.estimation.consistent.bodies import PACKED_IDENTITY, unpack
from scara_ident.estimation.consistent.cones import Cones

Array = NDArray[np.float64]

# Newton's method stops when the divergence is known to this, relative to itself where it is large.
PRECISION = 1e-10
# On the way there this is enough, and the way is taken in strides of this factor.
ROUGH = 1e-2
STRIDE = 4.0
MOST_STEPS = 100
LINE_STEPS = 12
# Weights of the barrier of limits, the last so small that it moves nothing.
BARRIER = (1.0, 1e-2, 1e-4, 1e-6, 1e-8)
# Singular values below this share of the largest are equations that say nothing new.
DEPENDENT = 1e-9


def divergence(x: Array, pull: float = 1.0) -> float:
    """Return the divergence of bodies and rotors relative to nominal, shape (11 n,), from the nominal arm.

    With ``pull`` the nominal arm is 1/pull times as heavy (and the result differs by a constant).
    """
    n = len(x) // 11
    bodies = np.linalg.eigvalsh(unpack(x[: 10 * n].reshape(n, 10)))
    values = np.concatenate([bodies.ravel(), x[10 * n :]])
    if np.any(values <= 0.0):
        return np.inf
    return float(np.sum(pull * values - np.log(values) - 1.0))


def null_space(rows: Array) -> Array:
    """Return an orthonormal basis of the directions that rows do not see, shape (k, free)."""
    if rows.shape[0] == 0:
        return np.eye(rows.shape[1])
    _, singular, right = np.linalg.svd(rows)
    rank = int(np.count_nonzero(singular > DEPENDENT * singular[0])) if singular[0] > 0.0 else 0
    return np.asarray(right[rank:].T)


def nearest_to_nominal(start: Array, free: Array, limits: Cones) -> Array:
    """Find the bodies nearest to nominal along free directions.

    Parameters
    ----------
    start : ndarray, shape (11 n,)
        Bodies and rotors relative to nominal (see `Unknowns`), strictly possible and strictly within the limits.
    free : ndarray, shape (11 n, k)
        Directions along which nothing that torque tells changes.
    limits : Cones
        On the 11 n unknowns.

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
    bounded = bool(len(limits.nonnegative) or len(limits.ball))
    n = len(start) // 11
    x = start
    # A start much heavier than nominal goes there in strides, by nominal arms that get lighter.
    pull = 5.0 * n / max(5.0 * n, float(np.tile(PACKED_IDENTITY, n) @ start[: 10 * n] + start[10 * n :].sum()))
    while pull < 1.0:
        x = _newton(x, free, limits, BARRIER[0] if bounded else 0.0, pull, ROUGH)
        pull *= STRIDE
    for weight in BARRIER if bounded else (0.0,):
        x = _newton(x, free, limits, weight, 1.0, PRECISION)
    return x


def _newton(start: Array, free: Array, limits: Cones, weight: float, pull: float, precision: float) -> Array:
    n = len(start) // 11
    directions = unpack(np.moveaxis(free[: 10 * n].reshape(n, 10, -1), 2, 1))
    x, value = start, _value(start, limits, weight, pull)
    for _ in range(MOST_STEPS):
        gradient, root, local = _slopes(x, n, directions, free, limits, weight, pull)
        triangular = np.asarray(np.linalg.qr(root, mode="r"))
        half = np.linalg.solve(triangular.T, gradient)
        step = -np.linalg.solve(triangular, half)
        decrement = float(half @ half)
        change = free @ step
        if decrement < precision * max(1.0, abs(value)):
            # The last step squares what error is left, and too little is gained to measure it.
            return x + change if np.isfinite(_value(x + change, limits, weight, pull)) else x
        length = 1.0 if weight else _length(np.tensordot(local, step, axes=(1, 0)), change, x, pull)
        while True:
            trial = x + length * change
            new = _value(trial, limits, weight, pull)
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
        f"the bodies nearest to the nominal ones were not found in {MOST_STEPS} steps; correct the URDF's inertias"
    )


def _length(local: Array, change: Array, x: Array, pull: float) -> float:
    """Length of the step that makes the divergence smallest along it.

    Near the edge Newton's own length only doubles the distance from it; along a line the divergence is a sum of
    logarithms, and its best length is the root of a rising function. Limits are not seen.
    """
    n = len(local)
    rates = np.concatenate([np.linalg.eigvalsh(local).ravel(), change[10 * n :] / x[10 * n :]])
    linear = pull * float(np.tile(PACKED_IDENTITY, n) @ change[: 10 * n] + change[10 * n :].sum())
    fastest = float(np.min(rates))
    low, high = 0.0, (1.0 / -fastest if fastest < 0.0 else 1e12)
    length = min(1.0, 0.5 * high)
    for _ in range(LINE_STEPS):
        share = rates / (1.0 + length * rates)
        slope = linear - float(share.sum())
        if slope > 0.0:
            high = length
        else:
            low = length
        trial = length - slope / max(float(share @ share), np.finfo(float).tiny)
        # Newton along the line where it stays between the bounds, their middle in ratio where not.
        length = trial if low < trial < high else (np.sqrt(low * high) if low > 0.0 else 0.1 * high)
    return float(length)


def _value(x: Array, limits: Cones, weight: float, pull: float) -> float:
    value = divergence(x, pull)
    if weight == 0.0 or not np.isfinite(value):
        return value
    slack = limits.nonnegative(x)
    cones = limits.ball(x).reshape(-1, 4)
    room = cones[:, 0] ** 2 - np.sum(cones[:, 1:] ** 2, axis=1)
    if np.any(slack <= 0.0) or np.any(room <= 0.0) or np.any(cones[:, 0] <= 0.0):
        return np.inf
    return value - weight * float(np.sum(np.log(slack)) + np.sum(np.log(room)))


def _slopes(
    x: Array, n: int, directions: Array, free: Array, limits: Cones, weight: float, pull: float
) -> tuple[Array, Array, Array]:
    """Gradient along the free directions, a square root of the Hessian as rows, and the directions seen from x."""
    inverse_root = np.linalg.inv(np.linalg.cholesky(unpack(x[: 10 * n].reshape(n, 10))))
    # In the metric of the point itself, each direction is a symmetric matrix per body.
    local = inverse_root[:, None] @ directions @ np.swapaxes(inverse_root, 1, 2)[:, None]
    rotors = free[10 * n :]
    own = rotors / x[10 * n :, None]
    trace = np.trace(local, axis1=2, axis2=3)
    linear = np.tile(PACKED_IDENTITY, n) @ free[: 10 * n] + rotors.sum(axis=0)
    gradient = pull * linear - trace.sum(axis=0) - own.sum(axis=0)
    count = free.shape[1]
    rows = [np.moveaxis(local, 1, 3).reshape(16 * n, count), own]
    if weight > 0.0:
        slack = limits.nonnegative(x)
        closing = limits.nonnegative.matrix @ free / slack[:, None]
        gradient = gradient - weight * closing.sum(axis=0)
        rows.append(np.sqrt(weight) * closing)
        for first in range(0, len(limits.ball), 4):
            slope, root = _ball(limits.ball.matrix[first : first + 4] @ free, limits.ball(x)[first : first + 4])
            gradient = gradient + weight * slope
            rows.append(np.sqrt(weight) * root)
    return gradient, np.vstack(rows), local


def _ball(rows: Array, value: Array) -> tuple[Array, Array]:
    """Gradient and a root of the Hessian of -log(t^2 - |u|^2) along rows of (t, u)."""
    flip = np.array([1.0, -1.0, -1.0, -1.0])
    room = float(flip @ value**2)
    slope = -2.0 / room * (flip * value)
    hessian = np.outer(slope, slope) - 2.0 / room * np.diag(flip)
    return slope @ rows, np.linalg.cholesky(hessian).T @ rows
