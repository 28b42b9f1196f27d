"""The semidefinite programme, canonicalised once and solved again and again.

    minimise    |F theta - g|^2 + |W (x - x0)|^2    with the model's parameters  theta = T x
    subject to  Q_i >= eps 1  for every body, rotors, friction certificates, limits

F and g are a triangular factor and its right-hand side, so the size does not depend on how many samples there are.
Numerically the least-squares part is brought to ``|w|^2`` first: with the triangular factor R of the stacked rows
[F T; W] and the unconstrained minimiser c, ``x = c + R^-1 w``. The solver then sees the unit matrix as its quadratic
term, however ill-conditioned the data are, and only the constraints carry parameters: R^-1 and c. That is a
disciplined parametrised programme (Agrawal et al. 2019), so cvxpy's canonical form is a constant linear map of them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scara_ident.errors import EstimationError
from scara_ident.estimation.consistent.bodies import unpack, unpacking
from scara_ident.estimation.consistent.matching import Matcher
from scara_ident.estimation.consistent.options import ConsistentOptions
from scara_ident.estimation.consistent.unknowns import Unknowns, build_unknowns
from scara_ident.model.model import TorqueModel

Array = NDArray[np.float64]

# Every body keeps this share of its nominal pseudo-inertia: above what the solver leaves of its constraints, and small
# enough that no estimate moves by more than about this share of the nominal.
MARGIN = 1e-7
# The solver stops when the cost, in squared standard deviations of the noise, is known to this: half of a
# thousandth of a standard deviation in any parameter.
GAP = 1e-7
RELATIVE_GAP = 1e-9
FEASIBILITY = 1e-9
# A second run that stops short of these is still good to a hundredth of a standard deviation.
ACCEPTED_GAP = 1e-4
ACCEPTED_RELATIVE_GAP = 1e-6

_SETTINGS = {
    "verbose": False,
    "max_threads": 1,
    # Presolve and decomposition would change the shape of the problem with its numbers.
    "presolve_enable": False,
    "chordal_decomposition_enable": False,
    "tol_gap_abs": GAP,
    "tol_gap_rel": RELATIVE_GAP,
    "tol_feas": FEASIBILITY,
}
# Of the two runs the first goes without iterative refinement: its linear systems are well-scaled, and it takes
# half the time.
_FAST = {"iterative_refinement_enable": False}
_CAREFUL = {"iterative_refinement_enable": True, "tol_gap_abs": 1e-8}


@dataclass(frozen=True, eq=False)
class Point:
    """A solution.

    Attributes
    ----------
    x : ndarray, shape (size,)
        See `Unknowns`.
    auxiliary : ndarray
        Auxiliary unknowns.
    parameters : ndarray, shape (p,)
        The model's parameters.
    dual_bodies : ndarray, shape (n, 4, 4)
        Multipliers of the bodies: what the cost gains per share of the nominal body by which the body may lack.
    dual_nonnegative, dual_small, dual_ball : ndarray
        Multipliers of the other cones, in the order of their rows.
    cost : float
        Value of the objective.
    iterations : int
    seconds : float
        Time in the solver.
    """

    x: Array
    auxiliary: Array
    parameters: Array
    dual_bodies: Array
    dual_nonnegative: Array
    dual_small: Array
    dual_ball: Array
    cost: float
    iterations: int
    seconds: float


class Programme:
    """A compiled programme for one model and set of options; not to be shared by threads.

    Parameters
    ----------
    model : TorqueModel
    options : ConsistentOptions, optional

    Attributes
    ----------
    unknowns : Unknowns
    matcher : Matcher
    """

    def __init__(self, model: TorqueModel, options: ConsistentOptions | None = None) -> None:
        self.options = options or ConsistentOptions()
        self.unknowns: Unknowns = build_unknowns(model, self.options)
        self.matcher = Matcher(self.unknowns)
        self._solver: Any = None

    @cached_property
    def problem(self) -> Any:
        """The parametrised cvxpy problem, built when it is first needed."""
        import cvxpy as cp

        u = self.unknowns
        size = u.size
        w, auxiliary = cp.Variable(size, name="w"), cp.Variable(u.auxiliary, name="auxiliary")
        # The triangle's entries as one vector: a parameter's value then goes into the canonical form as it is.
        entries = cp.Parameter(size * (size + 1) // 2, name="root")
        centre = cp.Parameter(size, name="centre")
        root = cp.reshape(_triangle(size) @ entries, (size, size), order="C")
        constraints = constraints_on(u, centre + root @ w, auxiliary)
        self._w, self._auxiliary, self._root, self._centre = w, auxiliary, entries, centre
        return cp.Problem(cp.Minimize(cp.sum_squares(w)), constraints)

    def solve(self, factor: Array, target: Array, prior: Array) -> Point:
        """Solve for one set of data.

        Parameters
        ----------
        factor : ndarray, shape (r, p)
            Rows of the data term, such as a triangular factor divided by the noise.
        target : ndarray, shape (r,)
        prior : ndarray, shape (size, size)
            Rows W on the unknowns' distance from their reference; of full rank, so that there is one solution.

        Returns
        -------
        Point

        Raises
        ------
        EstimationError
            If the solver does not succeed.
        """
        u = self.unknowns
        return self.solve_rows(factor @ u.to_parameters, target, prior)

    def solve_rows(self, rows: Array, target: Array, prior: Array) -> Point:
        """Solve with rows that act on x instead of the model's parameters; see `solve`."""
        from scipy.linalg.lapack import dtrtri

        u = self.unknowns
        stacked = np.vstack([np.column_stack([rows, target]), np.column_stack([prior, prior @ u.reference])])
        triangular: Array = np.asarray(np.linalg.qr(stacked, mode="r"))
        root, info = dtrtri(triangular[: u.size, : u.size])
        if info:
            raise EstimationError("the data hold numbers that are not finite, or a weight of the prior is 0")
        root = np.triu(root)
        centre = root @ triangular[: u.size, u.size]
        left_over = float(np.sum(triangular[u.size :, u.size] ** 2))
        w, auxiliary, z, result = self._run(root, centre)
        return self._point(centre + root @ w, auxiliary, z, left_over + float(w @ w), result)

    def _run(self, root: Array, centre: Array) -> tuple[Array, Array, Array, Any]:
        import cvxpy as cp

        problem = self.problem
        self._root.value = root[np.triu_indices(root.shape[0])]
        self._centre.value = centre
        # Quick for parameters by the hundred; releases of cvxpy without it choose for themselves.
        backend = getattr(cp.settings, "COO_CANON_BACKEND", None)
        data = problem.get_problem_data(cp.CLARABEL, canon_backend=backend)[0]
        result = self._attempt(data, _FAST)
        if not self._is_good(result, strict=True):
            result = self._attempt(data, _CAREFUL)
            if not self._is_good(result, strict=False):
                raise EstimationError(_what_to_try(str(result.status)))
        found = np.array(result.x)
        places = data["param_prob"].var_id_to_col
        start = places[self._w.id]
        w = found[start : start + root.shape[0]]
        start = places.get(self._auxiliary.id, 0)
        return w, found[start : start + self.unknowns.auxiliary], np.array(result.z), result

    def _attempt(self, data: Any, extra: dict[str, Any]) -> Any:
        import clarabel
        import scipy.sparse as sp
        from cvxpy.reductions.solvers.conic_solvers.clarabel_conif import dims_to_solver_cones

        if extra is _FAST and self._solver is not None:
            # Only the constraints' numbers change; the factorisation's plan is kept.
            self._solver.update(A=data["A"], b=data["b"])
            return self._solver.solve()
        settings = clarabel.DefaultSettings()
        for name, value in {**_SETTINGS, **extra}.items():
            setattr(settings, name, value)
        cones = dims_to_solver_cones(data["dims"])
        solver = clarabel.DefaultSolver(sp.triu(data["P"]).tocsc(), data["c"], data["A"], data["b"], cones, settings)
        if extra is _FAST:
            self._solver = solver
        return solver.solve()

    @staticmethod
    def _is_good(result: Any, *, strict: bool) -> bool:
        status = str(result.status)
        if status == "Solved":
            return True
        if strict or status not in ("AlmostSolved", "InsufficientProgress"):
            return False
        gap = abs(result.obj_val - result.obj_val_dual)
        small = gap <= max(ACCEPTED_GAP, ACCEPTED_RELATIVE_GAP * abs(result.obj_val))
        return bool(small and result.r_prim <= 10.0 * FEASIBILITY)

    def _point(self, x: Array, auxiliary: Array, z: Array, cost: float, result: Any) -> Point:
        u = self.unknowns
        counts = [len(u.held), len(u.cones.nonnegative), len(u.cones.small), len(u.cones.ball), 10 * u.n]
        _, nonnegative, small, ball, bodies = np.split(z, np.cumsum(counts)[:-1])
        return Point(
            x=x,
            auxiliary=auxiliary,
            parameters=u.parameters(x),
            dual_bodies=unpack(bodies.reshape(u.n, 10)),
            dual_nonnegative=nonnegative,
            dual_small=small,
            dual_ball=ball,
            cost=cost,
            iterations=int(result.iterations),
            seconds=float(result.solve_time),
        )


def constraints_on(unknowns: Unknowns, x: Any, auxiliary: Any) -> list[Any]:
    """Write all constraints on cvxpy expressions.

    Parameters
    ----------
    unknowns : Unknowns
    x : cvxpy.Expression, shape (size,)
    auxiliary : cvxpy.Expression, shape (auxiliary,)

    Returns
    -------
    list of cvxpy.Constraint
        The bodies' linear matrix inequalities first, each one constant matrix times its body's ten unknowns.
    """
    import cvxpy as cp

    u, cones, matrix = unknowns, unknowns.cones, unpacking()
    whole = cp.hstack([x, auxiliary]) if u.auxiliary else x
    bodies = [cp.reshape(matrix @ x[10 * i : 10 * i + 10], (4, 4), order="C") for i in range(u.n)]
    constraints: list[Any] = [body >> MARGIN * np.eye(4) for body in bodies]
    if len(cones.nonnegative):
        constraints.append(_sparse(cones.nonnegative.matrix) @ whole + cones.nonnegative.offset >= MARGIN)
    if len(cones.small):
        d, e, f = (_sparse(cones.small.matrix[k::3]) @ whole + cones.small.offset[k::3] for k in range(3))
        constraints.append(cp.SOC(d + f, cp.vstack([d - f, 2.0 * e]), axis=0))
    if len(cones.ball):
        t, *parts = (_sparse(cones.ball.matrix[k::4]) @ whole + cones.ball.offset[k::4] for k in range(4))
        constraints.append(cp.SOC(t - MARGIN, cp.vstack(parts), axis=0))
    if len(u.held):
        constraints.append(_sparse(u.held) @ x == 0.0)
    return constraints


def _triangle(size: int) -> Any:
    """Return the constant matrix that writes the entries of an upper triangle, row by row, into a square one."""
    import scipy.sparse as sp

    rows, columns = np.triu_indices(size)
    count = len(rows)
    return sp.csr_array((np.ones(count), (size * rows + columns, np.arange(count))), shape=(size**2, count))


def _sparse(matrix: Array) -> Any:
    import scipy.sparse as sp

    return sp.csr_array(matrix)


def _what_to_try(status: str) -> str:
    if "PrimalInfeasible" in status:
        return (
            f"the programme has no solution (CLARABEL: {status}): the given masses, centres of mass and friction "
            "contradict each other; widen a tolerance or leave one out"
        )
    return (
        f"the programme was not solved (CLARABEL: {status}); try richer motion, another model, a larger prior_weight "
        "or fewer limits"
    )
