"""Friction that brakes and that the motor can overcome, exactly and on the whole range of speed.

A polynomial of degree 3 is nonnegative on [0, 1] if and only if it is ``t s(t) + (1 - t) r(t)``, and on the half
line if and only if it is ``r(t) + t s(t)``, with s and r sums of squares of degree 2 (Markov, Lukacs; see Nesterov
2000, "Squared functional systems and optimization problems"). A sum of squares of degree 2 is a positive
semidefinite 2x2 matrix between (1, t), so the condition is convex and needs no grid.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import UsageError
from scara_ident.estimation.consistent.constraints import Cone
from scara_ident.model.terms.constraints import BrakingPolynomial

Shape = Literal["dissipative", "lubricated"]

# Distance that a solved polynomial keeps from 0 and from the limit, as a share of `torque_unit`: above what the solver
# leaves of its constraints, below anything that friction can show.
MARGIN = 1e-8
# Share of a polynomial's size that rounding may leave of a root.
ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class Certificate:
    """Conditions on the scaled coefficients of one polynomial.

    The unknowns are the coefficients ``c_k = parameter_k speed**power_k / torque`` and then auxiliary ones.

    Attributes
    ----------
    auxiliary : int
        Number of auxiliary unknowns.
    unit : ndarray
        Parameter per coefficient.
    """

    cones: tuple[Cone, ...]
    auxiliary: int
    unit: Array


def certificate(polynomial: BrakingPolynomial, shape: Shape, margin: float = MARGIN) -> Certificate:
    """Write what a joint's friction must fulfil as cones.

    Parameters
    ----------
    shape : {"dissipative", "lubricated"}
        ``dissipative``: between 0 and the motor's limit at every speed up to the velocity limit. Without a
        velocity limit it is at least 0 at every speed, and the motor's limit cannot be used.
        ``lubricated``: that, and non-decreasing and concave in speed, as in lubricated gears beyond the Stribeck
        range (shear thinning).
    margin : float, optional
        Distance kept from 0 and the limit, as a share of `torque_unit`.

    Raises
    ------
    UsageError
        If the lubricated shape is asked for a joint without a velocity limit.
    """
    finite = np.isfinite(polynomial.speed)
    powers = np.array(polynomial.powers)
    unit = torque_unit(polynomial) / _speed(polynomial) ** powers
    # Coefficients of 1, t, t^2, t^3 as functions of the unknowns, of the friction and of what it leaves of the limit.
    spread = np.zeros((4, len(powers)))
    spread[powers, np.arange(len(powers))] = 1.0
    top = polynomial.limit / torque_unit(polynomial)
    sides = [(spread, np.array([-margin, 0.0, 0.0, 0.0]))]
    if finite and np.isfinite(top):
        sides.append((-spread, np.array([top - margin, 0.0, 0.0, 0.0])))
    label = f"friction of {polynomial.joint}"
    if shape == "lubricated":
        if not finite:
            raise UsageError(
                f"{polynomial.joint}: the lubricated shape of friction needs a velocity limit and the URDF gives "
                "none; give one (option speed) or use 'dissipative'"
            )
        (low, start), *high = sides
        matrix = np.vstack([LUBRICATED @ low, *(side.sum(axis=0) for side, _ in high)])
        offset = np.concatenate([LUBRICATED @ start, *([end.sum()] for _, end in high)])
        return Certificate((_linear(matrix, offset, label),), 0, unit)
    degree = int(powers.max())
    if degree < 2:
        ends = np.array([[1.0, 0.0, 0.0, 0.0], [float(finite), 1.0, 0.0, 0.0]])
        linear = [_linear(ends @ matrix, ends @ offset, label) for matrix, offset in sides]
        return Certificate(tuple(linear), 0, unit)
    squares = _ON_INTERVAL if finite else _ON_HALF_LINE[degree]
    unknowns = len(powers) + 2 * len(sides)
    cones = []
    for k, (matrix, offset) in enumerate(sides):
        wide = np.zeros((6, unknowns))
        wide[:4, : len(powers)] = matrix
        wide[[4, 5], len(powers) + 2 * k + np.arange(2)] = 1.0
        for table in squares:
            kind: Literal["semidefinite", "nonnegative"] = "semidefinite" if len(table) == 3 else "nonnegative"
            cones.append(Cone(kind, table @ wide, table[:, :4] @ offset, label))
    return Certificate(tuple(cones), 2 * len(sides), unit)


# Each sum of squares as a packed 2x2 matrix, in rows on (c0, c1, c2, c3, e, f) with free numbers e and f.
_ROOT = np.sqrt(2.0)
# t [a b; b g] + (1 - t) [c0 e; e f] with a = c0 + c1 - 2 e, b = (c2 + 2 e - f) / 2 and g = c3 + f.
_ON_INTERVAL = (
    np.array([[1, 0, 0, 0, 0, 0], [0, 0, 0, 0, _ROOT, 0], [0, 0, 0, 0, 0, 1]]),
    np.array([[1, 1, 0, 0, -2, 0], [0, 0, 1 / _ROOT, 0, _ROOT, -1 / _ROOT], [0, 0, 0, 1, 0, 1]]),
)
_ON_HALF_LINE = {
    # [c0 e; e c2] + t (c1 - 2 e): a matrix in place of the number would have to be singular.
    2: (
        np.array([[1, 0, 0, 0, 0, 0], [0, 0, 0, 0, _ROOT, 0], [0, 0, 1, 0, 0, 0]]),
        np.array([[0.0, 1.0, 0.0, 0.0, -2.0, 0.0]]),
    ),
    # [c0 e; e c2 - 2 f] + t [c1 - 2 e, f; f, c3].
    3: (
        np.array([[1, 0, 0, 0, 0, 0], [0, 0, 0, 0, _ROOT, 0], [0, 0, 1, 0, 0, -2]]),
        np.array([[0, 1, 0, 0, -2, 0], [0, 0, 0, 0, 0, _ROOT], [0, 0, 0, 1, 0, 0]]),
    ),
}
# At least 0 at rest, concave, and not falling at the limit: the second derivative is linear, so its ends decide, and
# then the slope falls, so its end decides.
LUBRICATED = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, -2.0, 0.0], [0.0, 0.0, -2.0, -6.0], [0.0, 1.0, 2.0, 3.0]])


def _linear(matrix: Array, offset: Array, label: str) -> Cone:
    kept = np.any(matrix != 0.0, axis=1)
    return Cone("nonnegative", matrix[kept], offset[kept], label)


def _speed(polynomial: BrakingPolynomial) -> float:
    """Return the speed that powers are scaled by: the velocity limit, else what is usual."""
    if np.isfinite(polynomial.speed):
        return polynomial.speed
    return 1.0 if polynomial.usual_speed is None else polynomial.usual_speed


def torque_unit(polynomial: BrakingPolynomial) -> float:
    """Return the torque that friction is scaled by: what is usual, else the motor's limit."""
    limit = polynomial.limit if np.isfinite(polynomial.limit) else np.inf
    usual = limit if polynomial.usual_torque is None else min(limit, polynomial.usual_torque)
    return float(usual) if np.isfinite(usual) else 1.0


def as_recorded(polynomial: BrakingPolynomial, factor: Array, value: Array) -> BrakingPolynomial:
    """Return a polynomial that knows how fast recordings are, and how large friction is in them.

    The solver leaves its constraints off by a share of the unit of its numbers. Friction may be anything beside 1 N m and
    1 rad/s, and next to nothing beside the motor's limit.

    Parameters
    ----------
    factor : ndarray, shape (r, p)
        Of [regressor | torque] over the noise of the torque, without its last column.
    value : ndarray, shape (p,)
        What friction is of about the size of.
    """
    places, powers = list(polynomial.columns), np.array(polynomial.powers)
    norms = np.linalg.norm(factor[:, places], axis=0)
    if len(powers) < 2 or not np.all(norms > 0.0):
        return polynomial
    # A column is as long as the speed's power is large; the first tells how large torque must be to be seen, too.
    speed = float((norms[-1] / norms[0]) ** (1.0 / (powers[-1] - powers[0])))
    torque = float(np.max(np.abs(value[places]) * speed**powers) + speed ** powers[0] / norms[0])
    return replace(polynomial, usual_speed=speed, usual_torque=torque)


@dataclass(frozen=True)
class FrictionFault:
    """Speeds at which a joint's friction is impossible.

    Attributes
    ----------
    kind : {"pushes", "exceeds"}
        It feeds energy in, or is more than the motor can overcome.
    start, stop : float
        Range of speed, rad/s or m/s; ``stop`` may be infinite.
    """

    joint: str
    kind: Literal["pushes", "exceeds"]
    start: float
    stop: float


def friction_faults(polynomial: BrakingPolynomial, parameters: Array) -> tuple[FrictionFault, ...]:
    """Find the speeds up to the velocity limit at which friction pushes or exceeds the motor's limit.

    Parameters
    ----------
    parameters : ndarray
        In the order of the polynomial's columns.

    Returns
    -------
    tuple of FrictionFault
        In the order of speed; empty for friction that a joint can have.
    """
    coefficients = np.zeros(4)
    coefficients[list(polynomial.powers)] = parameters
    found = [
        FrictionFault(polynomial.joint, "pushes", a, b) for a, b in negative_ranges(coefficients, polynomial.speed)
    ]
    if np.isfinite(polynomial.limit) and np.isfinite(polynomial.speed):
        over = -coefficients
        over[0] += polynomial.limit
        found += [FrictionFault(polynomial.joint, "exceeds", a, b) for a, b in negative_ranges(over, polynomial.speed)]
    return tuple(sorted(found, key=lambda fault: fault.start))


def negative_ranges(coefficients: Array, end: float) -> list[tuple[float, float]]:
    """Return where on [0, end] a cubic with coefficients of 1, v, v^2, v^3 is negative beyond rounding."""
    reach = end if np.isfinite(end) else _beyond_roots(coefficients)
    scaled = coefficients * reach ** np.arange(4)
    size = float(np.max(np.abs(scaled)))
    if size == 0.0:
        return []
    roots = np.roots(scaled[::-1])
    inside = np.sort(roots.real[(np.abs(roots.imag) < 1e-7) & (roots.real > 0.0) & (roots.real < 1.0)])
    edges = np.concatenate([[0.0], inside, [1.0]])
    found: list[tuple[float, float]] = []
    for start, stop in zip(edges[:-1], edges[1:], strict=True):
        # Between roots the sign does not change; the deepest of a few places decides against rounding.
        places = np.linspace(start, stop, 9)
        if np.min(np.polynomial.polynomial.polyval(places, scaled)) < -ROUNDING * size:
            if found and found[-1][1] == start:
                found[-1] = (found[-1][0], stop)
            else:
                found.append((start, stop))
    last = [(a * reach, b * reach) for a, b in found]
    if last and not np.isfinite(end) and found[-1][1] == 1.0:
        last[-1] = (last[-1][0], np.inf)
    return last


def _beyond_roots(coefficients: Array) -> float:
    """Return a speed beyond the last real root."""
    roots = np.roots(coefficients[::-1])
    real = roots.real[(np.abs(roots.imag) < 1e-7 * (1.0 + np.abs(roots.real)))]
    return 2.0 * max(1.0, float(np.max(real, initial=0.0)))


def shape_faults(polynomial: BrakingPolynomial, parameters: Array) -> tuple[str, ...]:
    """Say where friction breaks the lubricated shape: it falls with speed, or grows ever faster."""
    scaled = np.zeros(4)
    scaled[list(polynomial.powers)] = parameters * _speed(polynomial) ** np.array(polynomial.powers)
    size = ROUNDING * float(np.max(np.abs(scaled)))
    found = []
    if 2.0 * scaled[2] > size or 2.0 * scaled[2] + 6.0 * scaled[3] > size:
        found.append(f"friction of {polynomial.joint} grows more and more with speed")
    if scaled[1] + 2.0 * scaled[2] + 3.0 * scaled[3] < -size or scaled[1] < -size:
        found.append(f"friction of {polynomial.joint} falls with speed")
    return tuple(found)
