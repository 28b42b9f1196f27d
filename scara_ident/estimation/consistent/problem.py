"""The estimation problem: its dimensionless unknowns, and the semidefinite programme that is compiled once.

    minimise    |F theta - g|^2 + |W (x - x0)|^2    with the model's parameters  theta = T x
    subject to  Q_i >= eps 1  for every body, rotors, friction certificates, limits

F and g are a triangular factor and its right-hand side, so the size does not depend on how many samples there are.
Numerically the least-squares part is brought to ``|w|^2`` first: with the triangular factor R of the stacked rows
[F T; W] and the unconstrained minimiser c, ``x = c + R^-1 w``. The solver then sees the unit matrix as its quadratic
term, however ill-conditioned the data are, and only the constraints carry parameters: R^-1 and c. That is a
disciplined parametrised programme (Agrawal et al. 2019), so cvxpy's canonical form is a constant linear map of them.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.errors import EstimationError, UsageError
from scara_ident.estimation.consistent.constraints import Cone, Statement, body_limits
from scara_ident.estimation.consistent.friction import certificate
from scara_ident.estimation.consistent.nominal import Nominal, nominal
from scara_ident.estimation.consistent.options import ConsistentOptions, FrictionShape
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms.constraints import BrakingPolynomial, Nonnegative, constraints_of

# Every body keeps this share of its nominal pseudo-inertia: above what the solver leaves of its constraints, and small
# enough that no estimate moves by more than about this share of the nominal.
MARGIN = 1e-7
# Singular values below this share of the largest belong to equations that the others imply.
DEPENDENT = 1e-9
# A solution is accepted where the cost, in squared standard deviations of the noise, is known to this, which is a
# hundredth of a standard deviation in any parameter, and the constraints to that.
ACCEPTED_GAP = 1e-4
ACCEPTED_RELATIVE_GAP = 1e-6
ACCEPTED_RESIDUAL = 1e-8

_SETTINGS = {
    "max_threads": 1,
    # Presolve and decomposition would change the shape of the problem with its numbers.
    "presolve_enable": False,
    "chordal_decomposition_enable": False,
    # Half of a thousandth of a standard deviation in any parameter.
    "tol_gap_abs": 1e-7,
    "tol_gap_rel": 1e-9,
    "tol_feas": 1e-9,
    # The linear systems are well scaled; without refinement a solution takes half the time.
    "iterative_refinement_enable": False,
}
# The usual regularization leaves constraints off by 5e-8 where data have no noise.
_EXACT = {"static_regularization_constant": 1e-10, "tol_gap_abs": 1e-8}
_CAREFUL = _SETTINGS | _EXACT | {"iterative_refinement_enable": True}


@dataclass(frozen=True, eq=False)
class Unknowns:
    """What the problem solves for, and the constraints on it.

    The vector x holds the bodies relative to nominal (packed 4x4 matrices, ten numbers each), the rotors relative
    to nominal (n), and the parameters of all other columns in units of their own (m - b). Auxiliary unknowns of
    the friction certificates follow it in the vector [x; aux].

    Attributes
    ----------
    to_parameters : ndarray, shape (p, size)
        Takes x to the model's parameters.
    held : ndarray, shape (k, size)
        Rows that are zero: base parameters that the model leaves out.
    reference : ndarray, shape (size,)
        Mean of the prior: the nominal arm, and zero for everything else.
    arm : tuple of Cone
        Bodies (n), rotors (n), and then limits on masses and centres of mass; on the first 11 n of x.
    others : tuple of Cone
        Friction and signs of the other columns; on [x; aux].
    polynomials : tuple of BrakingPolynomial
        Friction of the joints, with columns counted in the model.
    shapes : tuple of {"lubricated", "dissipative", "free"}
        What each of them fulfils.
    nonnegative : ndarray of int
        Columns of the model that other terms declare nonnegative.
    place : slice
        Where the columns of bodies and rotors stand in the model.
    """

    model: TorqueModel
    nominal: Nominal
    to_parameters: Array
    held: Array
    reference: Array
    arm: tuple[Cone, ...]
    others: tuple[Cone, ...]
    polynomials: tuple[BrakingPolynomial, ...]
    shapes: tuple[FrictionShape, ...]
    nonnegative: NDArray[np.intp]
    auxiliary: int
    place: slice

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
    def cones(self) -> tuple[Cone, ...]:
        """All constraints of the estimation problem, on [x; aux]; the arm's keep `MARGIN` from their boundary."""
        total, rigid = self.size + self.auxiliary, np.arange(11 * self.n)
        return (*(cone.inside(MARGIN).at(rigid, total) for cone in self.arm), *self.others)

    def sizes(self, value: Array) -> Array:
        """Return the size of each parameter, shape (p,): its change when the nominal arm doubles, or its value."""
        return np.asarray(np.maximum(np.linalg.norm(self.to_parameters, axis=1), np.abs(value)))

    def margin(self, x: Array) -> float:
        """Return how far inside its constraints the arm at x is: the smallest eigenvalue of bodies and the like."""
        return min(cone.margin(x[self.rigid]) for cone in self.arm)

    def standard(self, x: Array) -> Array:
        """Return the standard parameters of bodies and rotors, shape (11 n,)."""
        return np.asarray(self.nominal.to_standard @ x[self.rigid])

    def parameters(self, x: Array) -> Array:
        """Return the model's parameters, shape (p,)."""
        return np.asarray(self.to_parameters @ x)


def build_unknowns(
    model: TorqueModel, options: ConsistentOptions, polynomials: Sequence[BrakingPolynomial] | None = None
) -> Unknowns:
    """Collect the unknowns and the constraints that the model's terms and the options declare.

    Friction whose shape is left to the data keeps what the friction of every arm does: it is dissipative.

    Raises
    ------
    UsageError
        If an option names a joint or link that does not exist, or asks for what the robot does not give.
    """
    robot, term = model.robot, model.rigid_body
    arm = nominal(robot)
    place = model.place(term)
    rigid, p = 11 * robot.n, len(model.columns)
    others = [k for k in range(p) if not place.start <= k < place.stop]
    size = rigid + len(others)
    where = {column: rigid + i for i, column in enumerate(others)}

    positive, own = declared(model, options)
    polynomials = own if polynomials is None else polynomials
    asked = [options.friction_of(p.joint) for p in polynomials]
    shapes: tuple[FrictionShape, ...] = tuple("dissipative" if shape == "auto" else shape for shape in asked)
    friction = [(p, certificate(p, shape)) for p, shape in zip(polynomials, shapes, strict=True) if shape != "free"]
    auxiliary = sum(piece.auxiliary for _, piece in friction)
    total = size + auxiliary
    cones = [Cone("nonnegative", np.eye(total)[[where[c]]], np.array([-MARGIN]), model.names[c]) for c in positive]
    unit, start = np.ones(p), size
    for polynomial, piece in friction:
        unit[list(polynomial.columns)] = piece.unit
        places = [*(where[c] for c in polynomial.columns), *range(start, start + piece.auxiliary)]
        # Matrices have a margin of their own, see `certificate`.
        parts = (cone.inside(MARGIN) if cone.kind == "nonnegative" else cone for cone in piece.cones)
        cones += [cone.at(places, total) for cone in parts]
        start += piece.auxiliary

    grouping = term.base.grouping @ arm.to_standard
    left_out = np.setdiff1d(np.arange(term.base.count), term.kept)
    to_parameters = np.zeros((p, size))
    to_parameters[place, :rigid] = grouping[term.kept]
    to_parameters[others, [where[c] for c in others]] = unit[others]
    held = np.zeros((len(left_out), size))
    held[:, :rigid] = grouping[left_out]
    held /= np.maximum(np.linalg.norm(held, axis=1, keepdims=True), np.finfo(float).tiny)
    return Unknowns(
        model=model,
        nominal=arm,
        to_parameters=to_parameters,
        held=held,
        reference=np.concatenate([arm.relative, np.zeros(len(others))]),
        arm=(*_bodies(model), *(cone.through(arm.to_standard) for cone in body_limits(robot, options))),
        others=tuple(cones),
        polynomials=tuple(polynomials),
        shapes=shapes,
        nonnegative=np.array(positive, dtype=np.intp),
        auxiliary=auxiliary,
        place=place,
    )


def _bodies(model: TorqueModel) -> Iterator[Cone]:
    robot = model.robot
    unit = np.eye(11 * robot.n)
    for i, link in enumerate(robot.links):
        yield Cone("semidefinite", unit[10 * i : 10 * i + 10], np.zeros(10), f"inertia of {link}")
    for i, joint in enumerate(robot.joints):
        yield Cone("nonnegative", unit[[10 * robot.n + i]], np.zeros(1), f"rotor inertia of {joint}")


def declared(model: TorqueModel, options: ConsistentOptions) -> tuple[list[int], list[BrakingPolynomial]]:
    """Columns that cannot be negative, and friction, as the terms declare them; columns are counted in the model."""
    joints = model.robot.joints
    for name in options.speed:
        if name not in joints:
            raise UsageError(f"speed: {name!r} is no identified joint; the joints are {', '.join(joints)}")
    for name in () if isinstance(options.friction, str) else options.friction:
        if name not in joints:
            raise UsageError(f"friction: {name!r} is no identified joint; the joints are {', '.join(joints)}")
    positive: list[int] = []
    polynomials: list[BrakingPolynomial] = []
    for term in model.terms:
        first = model.place(term).start
        for declared in constraints_of(term):
            if isinstance(declared, Nonnegative):
                positive += [first + c for c in declared.columns]
            elif isinstance(declared, BrakingPolynomial):
                speed = float(options.speed.get(declared.joint, declared.speed))
                columns = tuple(first + c for c in declared.columns)
                polynomials.append(replace(declared, columns=columns, speed=speed))
    return positive, polynomials


@dataclass(frozen=True, eq=False)
class Point:
    """A solution of the estimation problem.

    Attributes
    ----------
    x : ndarray, shape (size,)
        See `Unknowns`.
    auxiliary : ndarray
        Auxiliary unknowns.
    multipliers : tuple of ndarray
        Of each of `Unknowns.cones`: what the cost gains per unit by which the constraint is relaxed.
    """

    x: Array
    auxiliary: Array
    multipliers: tuple[Array, ...]


class Problem:
    """The compiled problem of one model and set of options; not to be shared by threads.

    Friction is that of ``polynomials`` where they are given, else as the model declares it.
    """

    def __init__(
        self,
        model: TorqueModel,
        options: ConsistentOptions | None = None,
        polynomials: Sequence[BrakingPolynomial] | None = None,
    ) -> None:
        self.options = options or ConsistentOptions()
        self.unknowns: Unknowns = build_unknowns(model, self.options, polynomials)

    @cached_property
    def cvxpy(self) -> Any:
        """The parametrised cvxpy problem, stated when it is first needed."""
        import cvxpy as cp

        u = self.unknowns
        # Releases of cvxpy before 1.9 know no variable of no numbers.
        self._w, self._auxiliary = cp.Variable(u.size, name="w"), cp.Variable(max(1, u.auxiliary), name="auxiliary")
        # The triangle's entries as one vector: a parameter's value then goes into the canonical form as it is.
        self._root = cp.Parameter(u.size * (u.size + 1) // 2, name="root")
        self._centre = cp.Parameter(u.size, name="centre")
        x = self._centre + cp.reshape(_triangle(u.size) @ self._root, (u.size, u.size), order="C") @ self._w
        self._statement, held = constraints_on(u, x, self._auxiliary)
        return cp.Problem(cp.Minimize(cp.sum_squares(self._w)), self._statement.constraints + held)

    def solve(self, rows: Array, target: Array, prior: Array) -> Point:
        """Solve for one set of data.

        Parameters
        ----------
        rows : ndarray, shape (r, size)
            Data on x: a triangular factor divided by the noise, times ``unknowns.to_parameters``.
        target : ndarray, shape (r,)
        prior : ndarray, shape (size, size)
            Rows W on the unknowns' distance from their reference; of full rank, so that there is one solution.

        Raises
        ------
        EstimationError
            If the solver does not succeed.
        """
        from scipy.linalg.lapack import dtrtri

        u = self.unknowns
        stacked = np.vstack([np.column_stack([rows, target]), np.column_stack([prior, prior @ u.reference])])
        triangular: Array = np.asarray(np.linalg.qr(stacked, mode="r"))
        root, info = dtrtri(triangular[: u.size, : u.size])
        if info:
            raise EstimationError("the data hold numbers that are not finite, or a weight of the prior is 0")
        centre = root @ triangular[: u.size, u.size]
        # A solution that stops short counts if a careful run brings no better one.
        for settings, accept in ((_SETTINGS, False), (_CAREFUL, True), (_SETTINGS, True)):
            status = self._run(root[np.triu_indices(u.size)], centre, settings, accept)
            if status == "Solved":
                break
        else:
            raise EstimationError(_what_to_try(status, self.options))
        # A variable that stands nowhere has no value in cvxpy.
        auxiliary = self._auxiliary.value if u.auxiliary else np.zeros(0)
        return Point(centre + root @ self._w.value, auxiliary, self._statement.multipliers())

    def _run(self, root: Array, centre: Array, settings: dict[str, Any], accept: bool) -> str:
        """Run Clarabel through cvxpy; ``Solved`` also stands for a solution that stops short and is accepted."""
        import cvxpy as cp

        # Quick for parameters by the hundred; releases of cvxpy without it choose for themselves.
        backend = getattr(cp.settings, "COO_CANON_BACKEND", None)
        options = {**settings, "accept_unknown": True}
        problem = self.cvxpy
        self._root.value, self._centre.value = root, centre
        data, chain, inverse = problem.get_problem_data(cp.CLARABEL, canon_backend=backend, solver_opts=options)
        result = unless_panic(lambda: chain.solve_via_data(problem, data, settings is _SETTINGS, False, settings))
        status = "Panic" if result is None else str(result.status)
        if accept and status in ("AlmostSolved", "InsufficientProgress"):
            gap = abs(result.obj_val - result.obj_val_dual)
            if gap <= max(ACCEPTED_GAP, ACCEPTED_RELATIVE_GAP * abs(result.obj_val)):
                status = "Solved" if result.r_prim <= ACCEPTED_RESIDUAL else status
        if status == "Solved":
            with warnings.catch_warnings():
                # cvxpy warns of an inaccurate solution by its status; its gap and residual are judged above.
                warnings.simplefilter("ignore", UserWarning)
                problem.unpack_results(result, chain, inverse)
        return status


def constraints_on(unknowns: Unknowns, x: Any, auxiliary: Any) -> tuple[Statement, list[Any]]:
    """State the constraints on cvxpy expressions for x and the auxiliary unknowns.

    Returns
    -------
    statement : Statement
        Of `Unknowns.cones`.
    held : list of cvxpy.Constraint
        That the base parameters which the model leaves out are zero.
    """
    import cvxpy as cp

    whole = cp.hstack([x, auxiliary]) if unknowns.auxiliary else x
    return Statement(unknowns.cones, whole), [unknowns.held @ x == 0.0] if len(unknowns.held) else []


def unless_panic(solve: Callable[[], Any]) -> Any:
    """Return what Clarabel finds, None where it panics, as it does when its numbers stop being finite."""
    try:
        return solve()
    except BaseException as error:
        # Panics of Rust are no `Exception`, and their class cannot be imported.
        if type(error).__name__ != "PanicException":
            raise
        return None


def _triangle(size: int) -> Any:
    """Return the constant matrix that writes the entries of an upper triangle, row by row, into a square one."""
    import scipy.sparse as sp

    rows, columns = np.triu_indices(size)
    count = len(rows)
    return sp.csr_array((np.ones(count), (size * rows + columns, np.arange(count))), shape=(size**2, count))


def _what_to_try(status: str, options: ConsistentOptions) -> str:
    # An arm that can exist is there unless something was given that none has.
    if "PrimalInfeasible" in status and (options.total_mass or options.link_mass or options.com != "free"):
        what = "has no solution"
        advice = (
            ": given masses, centres of mass and friction contradict each other; widen a tolerance or leave one out"
        )
    else:
        what = "was not solved"
        advice = "; record a motion with better excitation, use another model, or use the method wls, which does not require physical consistency"
    return f"the estimation problem {what} (CLARABEL: {status}){advice}"
