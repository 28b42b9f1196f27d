"""The unknowns of the programme, dimensionless, and how the model's parameters follow from them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scara_ident.errors import UsageError
from scara_ident.estimation.consistent.cones import Affine, Cones
from scara_ident.estimation.consistent.friction_certificate import certificate
from scara_ident.estimation.consistent.limits import body_limits
from scara_ident.estimation.consistent.nominal import Nominal, nominal
from scara_ident.estimation.consistent.options import ConsistentOptions
from scara_ident.estimation.consistent.prior import null_space
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms.constraints import BrakingPolynomial, Nonnegative, constraints_of

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Unknowns:
    """What the programme solves for.

    The vector x holds the bodies relative to nominal (packed 4x4 matrices, ten numbers each), the rotors relative
    to nominal (n), and the parameters of all other columns in units of their own (m - b). Auxiliary unknowns of
    the friction certificates follow it in the vector [x; aux] that the cones see.

    Attributes
    ----------
    model : TorqueModel
    nominal : Nominal
    to_parameters : ndarray, shape (p, size)
        Takes x to the model's parameters.
    held : ndarray, shape (k, size)
        Rows that are zero: base parameters that the model leaves out.
    reference : ndarray, shape (size,)
        Where the prior pulls: the nominal arm, and zero for everything else.
    cones : Cones
        On [x; aux].
    labels : tuple of tuple of str
        What each function of ``cones.nonnegative``, each 2x2 matrix of ``cones.small`` and each ball is about.
    limits : Cones
        The part of the cones that bounds masses and centres of mass, on the first 11 n of x.
    polynomials : tuple of (BrakingPolynomial)
        Friction of the joints, with columns counted in the model.
    nonnegative : ndarray of int
        Columns of the model that other terms declare nonnegative.
    auxiliary : int
    place : slice
        Where the columns of bodies and rotors stand in the model.
    sums : ndarray of int
        Those among them that are sums of what cannot be negative.
    unseen : ndarray, shape (11 n, k)
        Directions of bodies and rotors that change none of their columns.
    """

    model: TorqueModel
    nominal: Nominal
    to_parameters: Array
    held: Array
    reference: Array
    cones: Cones
    labels: tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]
    limits: Cones
    polynomials: tuple[BrakingPolynomial, ...]
    nonnegative: NDArray[np.intp]
    auxiliary: int
    place: slice
    sums: NDArray[np.intp]
    unseen: Array

    @property
    def n(self) -> int:
        """Number of bodies."""
        return self.nominal.n

    @property
    def size(self) -> int:
        """Length of x."""
        return len(self.reference)

    @property
    def rigid(self) -> slice:
        """Where bodies and rotors stand in x."""
        return slice(0, 11 * self.n)

    @property
    def bounded(self) -> NDArray[np.intp]:
        """Columns of the model whose scale is set by a torque limit and a velocity limit."""
        return np.array(
            [c for p in self.polynomials if np.isfinite(p.limit) and np.isfinite(p.speed) for c in p.columns],
            dtype=np.intp,
        )

    def standard(self, x: Array) -> Array:
        """Return the standard parameters of bodies and rotors, shape (11 n,)."""
        return np.asarray(self.nominal.to_standard @ x[self.rigid])

    def parameters(self, x: Array) -> Array:
        """Return the model's parameters, shape (p,)."""
        return np.asarray(self.to_parameters @ x)


def build_unknowns(model: TorqueModel, options: ConsistentOptions) -> Unknowns:
    """Collect the unknowns and the constraints that the model's terms and the options declare.

    Parameters
    ----------
    model : TorqueModel
    options : ConsistentOptions

    Returns
    -------
    Unknowns

    Raises
    ------
    UsageError
        If an option names a joint or link that does not exist, or asks for what the robot does not give.
    """
    robot, term = model.robot, model.rigid_body
    arm = nominal(robot)
    place = model.place(term)
    rigid = 11 * robot.n
    p = len(model.columns)
    others = [k for k in range(p) if not place.start <= k < place.stop]
    size = rigid + len(others)
    where = {column: rigid + i for i, column in enumerate(others)}

    grouping = term.base.grouping @ arm.to_standard
    left_out = np.setdiff1d(np.arange(term.base.count), term.kept)
    to_parameters = np.zeros((p, size))
    to_parameters[place, :rigid] = grouping[term.kept]
    held = np.zeros((len(left_out), size))
    held[:, :rigid] = grouping[left_out]
    held /= np.maximum(np.linalg.norm(held, axis=1, keepdims=True), np.finfo(float).tiny)

    unit = np.ones(p)
    polynomials, pieces, positive, auxiliary = [], [], [], 0
    for column_offset, constraint in _declared(model):
        if isinstance(constraint, Nonnegative):
            positive += [column_offset + c for c in constraint.columns]
        elif isinstance(constraint, BrakingPolynomial):
            polynomial = replace(
                constraint,
                columns=tuple(column_offset + c for c in constraint.columns),
                speed=_speed(constraint, options, robot.joints),
            )
            polynomials.append(polynomial)
            if options.friction != "free":
                piece = certificate(polynomial, options.friction)
                pieces.append((polynomial, piece))
                auxiliary += piece.auxiliary
                unit[list(polynomial.columns)] = piece.unit
    for column in others:
        to_parameters[column, where[column]] = unit[column]

    total = size + auxiliary
    cones, start = [_rotors(robot.n, total), _columns(positive, where, total)], size
    labels = [[f"rotor inertia of {joint}" for joint in robot.joints], [model.names[c] for c in positive]]
    for polynomial, piece in pieces:
        places = [where[c] for c in polynomial.columns] + list(range(start, start + piece.auxiliary))
        cones.append(piece.cones.at(places, total))
        labels.append([f"friction of {polynomial.joint}"])
        start += piece.auxiliary
    limits = _through(body_limits(robot, options), arm.to_standard)
    cones.append(limits.at(np.arange(rigid), total))
    labels.append(["given mass or centre of mass"])
    return Unknowns(
        model=model,
        nominal=arm,
        to_parameters=to_parameters,
        held=held,
        reference=np.concatenate([arm.relative, np.zeros(len(others))]),
        cones=Cones.stacked(cones, total),
        labels=(
            _labels(cones, labels, lambda c: len(c.nonnegative)),
            _labels(cones, labels, lambda c: len(c.small) // 3),
            _labels(cones, labels, lambda c: len(c.ball) // 4),
        ),
        limits=limits,
        polynomials=tuple(polynomials),
        nonnegative=np.array(positive, dtype=np.intp),
        auxiliary=auxiliary,
        place=place,
        sums=np.array([k for k in range(place.start, place.stop) if model.columns[k].nonnegative], dtype=np.intp),
        unseen=null_space(_unit_rows(grouping)),
    )


def _labels(cones: list[Cones], labels: list[list[str]], count: Callable[[Cones], int]) -> tuple[str, ...]:
    """Name every row: a part has a name for each of its rows, or one for all."""
    named: list[str] = []
    for part, names in zip(cones, labels, strict=True):
        named += names if len(names) == count(part) else names * count(part)
    return tuple(named)


def _declared(model: TorqueModel) -> Iterator[tuple[int, object]]:
    for term in model.terms:
        for constraint in constraints_of(term):
            yield model.place(term).start, constraint


def _unit_rows(rows: Array) -> Array:
    return np.asarray(rows / np.linalg.norm(rows, axis=1, keepdims=True))


def _speed(polynomial: BrakingPolynomial, options: ConsistentOptions, joints: tuple[str, ...]) -> float:
    for name in options.speed:
        if name not in joints:
            raise UsageError(f"speed: {name!r} is no identified joint; the joints are {', '.join(joints)}")
    return float(options.speed.get(polynomial.joint, polynomial.speed))


def _rotors(n: int, unknowns: int) -> Cones:
    rows = np.zeros((n, unknowns))
    rows[:, 10 * n : 11 * n] = np.eye(n)
    return Cones.linear(Affine(rows, np.zeros(n)))


def _columns(columns: list[int], where: dict[int, int], unknowns: int) -> Cones:
    rows = np.zeros((len(columns), unknowns))
    rows[np.arange(len(columns)), [where[c] for c in columns]] = 1.0
    return Cones.linear(Affine(rows, np.zeros(len(columns))))


def _through(cones: Cones, matrix: Array) -> Cones:
    """Write cones on ``matrix @ x`` as cones on x."""
    return Cones(*(Affine(part.matrix @ matrix, part.offset) for part in (cones.nonnegative, cones.small, cones.ball)))
