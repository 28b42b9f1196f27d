"""Convex constraints: affine functions of the unknowns and the cone that each must lie in.

They are kept as numbers because four computations read them: cvxpy states them in the estimation problem, the
feasibility question and the Newton method of the prior use their rows, and the covariance uses those that are active.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.errors import UsageError
from scara_ident.estimation.consistent.bodies import pack, unpack, unpacking
from scara_ident.estimation.consistent.options import ConsistentOptions, Ellipsoid
from scara_ident.robot.robot import Robot
from scara_ident.robot.visual_boxes import visual_boxes


@dataclass(frozen=True, eq=False)
class Cone:
    """The constraint that ``matrix @ x + offset`` lies in a cone.

    Attributes
    ----------
    kind : {"nonnegative", "ball", "semidefinite"}
        Every entry is at least 0; the first entry is at least the length of the others; or the entries are a packed
        positive semidefinite matrix (see `pack`).
    matrix : ndarray, shape (k, unknowns)
    offset : ndarray, shape (k,)
    label : str
        What the constraint is about, such as ``inertia of link2``.
    """

    kind: Literal["nonnegative", "ball", "semidefinite"]
    matrix: Array
    offset: Array
    label: str = ""

    def __call__(self, x: Array) -> Array:
        """Evaluate the function, shape (k,)."""
        return np.asarray(self.matrix @ x + self.offset)

    @property
    def identity(self) -> Array:
        """The unit of the cone, shape (k,): ones, a ball's axis, or the packed unit matrix."""
        if self.kind == "nonnegative":
            return np.ones(len(self.offset))
        if self.kind == "ball":
            return np.asarray(np.eye(len(self.offset))[0])
        return pack(np.eye(self.order))

    @property
    def order(self) -> int:
        """Size of the matrix of a semidefinite cone."""
        return int(np.sqrt(2 * len(self.offset)))

    def margin(self, x: Array) -> float:
        """Return the largest multiple of the identity that the value at x exceeds; negative outside the cone."""
        value = self(x)
        if self.kind == "nonnegative":
            return float(np.min(value))
        if self.kind == "ball":
            return float(value[0] - np.linalg.norm(value[1:]))
        return float(np.linalg.eigvalsh(unpack(value))[0])

    def inside(self, margin: float) -> Cone:
        """Return the constraint that keeps this multiple of the identity from the boundary."""
        return replace(self, offset=self.offset - margin * self.identity)

    def at(self, places: Sequence[int] | NDArray[np.intp], unknowns: int) -> Cone:
        """Return the same constraint on a longer vector in which these unknowns stand at ``places``."""
        wide = np.zeros((len(self.offset), unknowns))
        wide[:, places] = self.matrix
        return replace(self, matrix=wide)

    def through(self, matrix: Array) -> Cone:
        """Write the constraint on ``matrix @ x`` as one on x."""
        return replace(self, matrix=self.matrix @ matrix)


class Statement:
    """Constraints as cvxpy states them.

    All inequalities become one constraint, and all 2x2 matrices one with second-order cones: cvxpy then compiles the
    problem of SCARA03 in half of the time that one constraint per cone takes.

    Parameters
    ----------
    x : cvxpy.Expression, shape (unknowns,)
    """

    def __init__(self, cones: Sequence[Cone], x: Any) -> None:
        import cvxpy as cp

        kinds = ["small" if len(c.offset) == 3 and c.kind == "semidefinite" else c.kind for c in cones]
        together = [[k for k, kind in enumerate(kinds) if kind == wanted] for wanted in ("nonnegative", "small")]
        alone = [[k] for k, kind in enumerate(kinds) if kind in ("ball", "semidefinite")]
        self._groups = [group for group in (*together, *alone) if group]
        self._cones = cones
        self.constraints: list[Any] = []
        for group in self._groups:
            value = _affine([cones[k] for k in group], x)
            kind = kinds[group[0]]
            if kind == "nonnegative":
                self.constraints.append(value >= 0.0)
            elif kind == "small":
                first, product, second = value[0::3], value[1::3], value[2::3]
                # A matrix: cvxpy 1.9 with SciPy 1.17 fails on some products of a number and what has parameters.
                wide = np.sqrt(2.0) * np.eye(len(group)) @ product
                lengths = cp.vstack([first - second, wide])
                self.constraints.append(cp.SOC(first + second, lengths, axis=0))
            elif kind == "ball":
                self.constraints.append(cp.SOC(value[0], value[1:]))
            else:
                size = cones[group[0]].order
                matrix = unpacking(len(cones[group[0]].offset))
                self.constraints.append(cp.reshape(matrix @ value, (size, size), order="C") >> 0)

    def multipliers(self) -> tuple[Array, ...]:
        """Return the multipliers of each cone at the solution, packed where the cone is of matrices."""
        found: list[Array] = [np.zeros(0)] * len(self._cones)
        for group, constraint in zip(self._groups, self.constraints, strict=True):
            dual = constraint.dual_value
            cone = self._cones[group[0]]
            if cone.kind == "nonnegative":
                parts = np.split(dual, np.cumsum([len(self._cones[k].offset) for k in group])[:-1])
            elif cone.kind == "ball":
                parts = [np.concatenate([np.ravel(part) for part in dual])]
            elif cone.order == 2:
                total, (difference, product) = np.ravel(dual[0]), np.reshape(dual[1], (2, -1))
                parts = list(np.array([total + difference, np.sqrt(2.0) * product, total - difference]).T)
            else:
                parts = [pack(dual)]
            for k, part in zip(group, parts, strict=True):
                found[k] = part
        return tuple(found)


def _affine(cones: Sequence[Cone], x: Any) -> Any:
    import scipy.sparse as sp

    matrix = sp.csr_array(np.vstack([cone.matrix for cone in cones]))
    return matrix @ x + np.concatenate([cone.offset for cone in cones])


def active_set(cones: Iterable[Cone], x: Array, multipliers: Iterable[Array]) -> tuple[Array, tuple[str, ...]]:
    """Find the constraints that are active at a solution.

    The solver brings the product of a constraint's multiplier and its slack to zero; it is active where the
    multiplier is the larger of the two.

    Parameters
    ----------
    x : ndarray, shape (unknowns,)
    multipliers : iterable of ndarray
        Of each cone, shape (k,), packed where the cone is of matrices.

    Returns
    -------
    rows : ndarray, shape (active, unknowns)
        Directions of x that the active constraints forbid, to first order.
    labels : tuple of str
        What they are about, each once.
    """
    rows, labels = [np.zeros((0, len(x)))], []
    for cone, multiplier in zip(cones, multipliers, strict=True):
        value = cone(x)
        if cone.kind == "nonnegative":
            active = cone.matrix[multiplier > value]
        elif cone.kind == "ball":
            is_active = np.linalg.norm(multiplier) > value[0] - np.linalg.norm(value[1:])
            active = (multiplier @ cone.matrix)[None, :][: int(is_active)]
        else:
            active = _face(unpack(value), unpack(multiplier)) @ cone.matrix
        rows.append(active)
        labels += [cone.label] * len(active)
    return np.vstack(rows), tuple(dict.fromkeys(labels))


def _face(value: Array, multiplier: Array) -> Array:
    """Packed symmetric products of the directions in which a matrix is held at zero, as rows."""
    size, vectors = np.linalg.eigh(multiplier)
    slack = np.einsum("ik,ij,jk->k", vectors, value, vectors)
    held = vectors[:, size > slack].T
    first, second = np.triu_indices(len(held))
    outer = held[first, :, None] * held[second, None, :]
    return pack(0.5 * (outer + np.swapaxes(outer, 1, 2)))


def body_limits(robot: Robot, options: ConsistentOptions) -> tuple[Cone, ...]:
    """Collect what the options say of masses and centres of mass.

    Returns
    -------
    tuple of Cone
        On the 11 n standard parameters, each scaled to its tolerance or size.

    Raises
    ------
    UsageError
        If a link or joint does not exist.
    RobotError
        If the visual shape of a link is asked for and cannot be had.
    """
    unknowns = 11 * robot.n
    found: list[Cone] = []
    if options.total_mass is not None:
        found.append(_mass(range(robot.n), *options.total_mass, unknowns))
    for name, (value, tolerance) in options.link_mass.items():
        found.append(_mass([_body(robot, name, "link_mass")], value, tolerance, unknowns))
    if options.com == "visual":
        found += [_box(i, low, high, unknowns) for i, (low, high) in enumerate(visual_boxes(robot))]
    elif not isinstance(options.com, str):
        found += [_ellipsoid(_body(robot, name, "com"), e, unknowns) for name, e in options.com.items()]
    return tuple(replace(cone, label="given mass or centre of mass") for cone in found)


def _body(robot: Robot, name: str, option: str) -> int:
    """Return the place of a body by its link's or joint's name."""
    for names in (robot.links, robot.joints):
        if name in names:
            return names.index(name)
    known = ", ".join(robot.links)
    raise UsageError(f"{option}: {name!r} is neither an identified link nor joint; the links are {known}")


def _mass(bodies: Iterable[int], value: float, tolerance: float, unknowns: int) -> Cone:
    row = np.zeros(unknowns)
    row[[10 * i for i in bodies]] = 1.0 / tolerance
    return Cone("nonnegative", np.array([row, -row]), np.array([1.0 - value / tolerance, 1.0 + value / tolerance]))


def _box(body: int, low: Array, high: Array, unknowns: int) -> Cone:
    width = (high - low)[:, None]
    rows = np.zeros((6, unknowns))
    rows[:, 10 * body : 10 * body + 4] = np.vstack(
        [np.column_stack([-low, np.eye(3)]) / width, np.column_stack([high, -np.eye(3)]) / width]
    )
    return Cone("nonnegative", rows, np.zeros(6))


def _ellipsoid(body: int, ellipsoid: Ellipsoid, unknowns: int) -> Cone:
    centre, radii = np.array(ellipsoid.centre), np.array(ellipsoid.radii)
    if not np.all(radii > 0.0):
        raise UsageError(f"com: a radius of {radii.min():g} m; expected a length above 0")
    rows = np.zeros((4, unknowns))
    rows[0, 10 * body] = 1.0
    rows[1:, 10 * body : 10 * body + 4] = np.column_stack([-centre, np.eye(3)]) / radii[:, None]
    return Cone("ball", rows, np.zeros(4))
