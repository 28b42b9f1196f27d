"""Friction that brakes and that the motor can overcome, exactly and on the whole range of speed.

A polynomial of degree 3 is nonnegative on [0, 1] if and only if it is ``t s(t) + (1 - t) r(t)``, and on the half
line if and only if it is ``r(t) + t s(t)``, with s and r sums of squares of degree 2 (Markov, Lukacs; see Nesterov
2000, "Squared functional systems and optimization problems"). A sum of squares of degree 2 is a positive
semidefinite 2x2 matrix between (1, t), so the condition is convex and needs no grid.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from scara_ident.errors import UsageError
from scara_ident.estimation.consistent.cones import Affine, Cones
from scara_ident.model.terms.constraints import BrakingPolynomial

Array = NDArray[np.float64]
Shape = Literal["dissipative", "lubricated"]

# Distance that a solved polynomial keeps from 0 and from the limit, as a share of the limit: above what the solver
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
    cones : Cones
    auxiliary : int
        Number of auxiliary unknowns.
    unit : ndarray
        Parameter per coefficient.
    """

    cones: Cones
    auxiliary: int
    unit: Array


def certificate(polynomial: BrakingPolynomial, shape: Shape, margin: float = MARGIN) -> Certificate:
    """Write what a joint's friction must fulfil as cones.

    Parameters
    ----------
    polynomial : BrakingPolynomial
    shape : {"dissipative", "lubricated"}
        ``dissipative``: between 0 and the motor's limit at every speed up to the velocity limit. Without a
        velocity limit it is at least 0 at every speed, and the motor's limit cannot be used.
        ``lubricated``: that, and non-decreasing and concave in speed, as in lubricated gears beyond the Stribeck
        range (shear thinning).
    margin : float, optional
        Distance kept from 0 and the limit, as a share of the limit.

    Returns
    -------
    Certificate

    Raises
    ------
    UsageError
        If the lubricated shape is asked for a joint without a velocity limit.
    """
    finite = np.isfinite(polynomial.speed)
    powers = np.array(polynomial.powers)
    unit = _torque(polynomial) / _speed(polynomial) ** powers
    size = len(powers)
    # Coefficients of 1, t, t^2, t^3 as functions of the unknowns.
    spread = np.zeros((4, size))
    spread[powers, np.arange(size)] = 1.0
    low = Affine(spread, np.array([-margin, 0.0, 0.0, 0.0]))
    top = polynomial.limit / _torque(polynomial)
    high = Affine(-spread, np.array([top - margin, 0.0, 0.0, 0.0]))
    if shape == "lubricated":
        if not finite:
            raise UsageError(
                f"{polynomial.joint}: the lubricated shape of friction needs a velocity limit and the URDF gives "
                "none; give one (option speed) or use 'dissipative'"
            )
        return Certificate(Cones.linear(_lubricated(low, high if np.isfinite(top) else None)), 0, unit)
    sides = [low, high] if finite and np.isfinite(top) else [low]
    degree = int(powers.max())
    parts = [_nonnegative(side, degree, finite, k, len(sides)) for k, side in enumerate(sides)]
    auxiliary = 0 if degree < 2 else _AUXILIARY * len(sides)
    return Certificate(Cones.stacked(parts, size + auxiliary), auxiliary, unit)


# A certificate of degree 2 or 3 has six numbers for four coefficients.
_AUXILIARY = 2


def _speed(polynomial: BrakingPolynomial) -> float:
    return polynomial.speed if np.isfinite(polynomial.speed) else 1.0


def _torque(polynomial: BrakingPolynomial) -> float:
    return polynomial.limit if np.isfinite(polynomial.limit) else 1.0


def _lubricated(low: Affine, high: Affine | None) -> Affine:
    # Concave: the second derivative is linear, so its ends decide; then the slope falls, so its end decides.
    c = low.matrix
    rows = [
        c[0],
        -2.0 * c[2],
        -2.0 * c[2] - 6.0 * c[3],
        c[1] + 2.0 * c[2] + 3.0 * c[3],
    ]
    offset = [low.offset[0], 0.0, 0.0, 0.0]
    if high is not None:
        rows.append(high.matrix.sum(axis=0))
        offset.append(high.offset[0])
    kept = [k for k, row in enumerate(rows) if np.any(row)]
    return Affine(np.array(rows)[kept], np.array(offset)[kept])


def _nonnegative(side: Affine, degree: int, finite: bool, place: int, sides: int) -> Cones:
    """Conditions under which a polynomial with these coefficients is at least 0."""
    c = side
    size = c.matrix.shape[1]
    if degree < 2:
        ends = np.array([[1.0, 0, 0, 0], [1.0, 1.0, 0, 0]] if finite else [[1.0, 0, 0, 0], [0, 1.0, 0, 0]])
        rows = Affine(ends @ c.matrix, ends @ c.offset)
        kept = np.any(rows.matrix != 0.0, axis=1)
        return Cones.linear(Affine(rows.matrix[kept], rows.offset[kept]))
    unknowns = size + _AUXILIARY * sides
    wide = c.widened(unknowns)
    free = np.zeros((2, unknowns))
    free[[0, 1], size + _AUXILIARY * place + np.arange(2)] = 1.0
    c0, c1, c2, c3 = (_row(wide, k) for k in range(4))
    e, f = (_Row(free[k], 0.0) for k in range(2))
    if finite:
        # t [a b; b g] + (1 - t) [d e; e f], with e and f free and the rest from the coefficients.
        d = c0
        a = c1 - e * 2.0 + d
        g = c3 + f
        b = (c2 - f + e * 2.0) * 0.5
        return Cones(Affine.none(unknowns), _rows([d, e, f, a, b, g]), Affine.none(unknowns))
    if degree == 2:
        # [d e; e f] + t k with a number k: a matrix would have to be singular.
        return Cones(_rows([c1 - e * 2.0]), _rows([c0, e, c2]), Affine.none(unknowns))
    # [d e; e h] + t [a b; b g], with e and b (here f) free.
    return Cones(Affine.none(unknowns), _rows([c0, e, c2 - f * 2.0, c1 - e * 2.0, f, c3]), Affine.none(unknowns))


@dataclass(frozen=True, eq=False)
class _Row:
    """One affine function, with the arithmetic that the certificates are written in."""

    row: Array
    offset: float

    def __add__(self, other: _Row) -> _Row:
        return _Row(self.row + other.row, self.offset + other.offset)

    def __sub__(self, other: _Row) -> _Row:
        return _Row(self.row - other.row, self.offset - other.offset)

    def __mul__(self, factor: float) -> _Row:
        return _Row(factor * self.row, factor * self.offset)


def _row(affine: Affine, k: int) -> _Row:
    return _Row(affine.matrix[k], float(affine.offset[k]))


def _rows(rows: list[_Row]) -> Affine:
    return Affine(np.array([r.row for r in rows]), np.array([r.offset for r in rows]))


@dataclass(frozen=True)
class FrictionFault:
    """Speeds at which a joint's friction is impossible.

    Attributes
    ----------
    joint : str
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
    polynomial : BrakingPolynomial
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
        found.append(f"friction of {polynomial.joint} grows ever faster with speed")
    if scaled[1] + 2.0 * scaled[2] + 3.0 * scaled[3] < -size or scaled[1] < -size:
        found.append(f"friction of {polynomial.joint} falls with speed")
    return tuple(found)
