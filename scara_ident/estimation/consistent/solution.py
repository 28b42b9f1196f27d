"""From a triangular factor to the possible arm that explains it best, in two steps.

First the parameters. Where least squares, each joint weighted by its residual, belongs to an arm that can exist, it is
the solution and no prior acts on it. Else the estimation problem is solved, with a weak prior so that directions which
the data hardly determine do not follow the noise to the edge of what is possible.

Then the bodies: among those that have these parameters, the nearest to the nominal ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import EstimationError, UsageError
from scara_ident.estimation.consistent.feasibility import ROUNDING, fixed, fixed_columns, furthest_inside
from scara_ident.estimation.consistent.friction import friction_faults, shape_faults
from scara_ident.estimation.consistent.options import ConsistentOptions
from scara_ident.estimation.consistent.prior import nearest_to_nominal, prior_rows
from scara_ident.estimation.consistent.problem import DEPENDENT, MARGIN, Point, Problem, Unknowns
from scara_ident.estimation.information import (
    MIN_NOISE_SHARE,
    UNDETERMINED,
    Information,
    Solution,
    joint_noise,
    merge,
    weighted,
)
from scara_ident.threads import one_blas_thread

# The solver's constraints are kept to this, relative to the nominal bodies.
DIGITS = 1e-6


@dataclass(frozen=True, eq=False)
class StandardPrior:
    """Priors on standard parameters.

    Attributes
    ----------
    rows : ndarray, shape (k, 11 n)
        Each divided by its standard deviation.
    target : ndarray, shape (k,)
    """

    rows: Array
    target: Array


@dataclass(frozen=True, eq=False)
class ConsistentSolution:
    """The best possible arm for one factor.

    Attributes
    ----------
    x : ndarray
        See `Unknowns`; undetermined directions are not yet nearest to nominal, see `nearest_arm`.
    value : ndarray, shape (p,)
        The model's parameters.
    point : Point or None
        Solution of the estimation problem; None where plain least squares is possible.
    """

    x: Array
    value: Array
    point: Point | None

    @property
    def was_possible(self) -> bool:
        """Whether plain least squares is possible."""
        return self.point is None


@one_blas_thread()
def solve_joints(
    problem: Problem,
    joints: Sequence[Information],
    *,
    parameter_prior: Information | None = None,
    standard_prior: StandardPrior | None = None,
) -> tuple[ConsistentSolution, Information, Array]:
    """Find the best possible parameters for the rows of all joints, each divided by its joint's noise.

    Parameters
    ----------
    joints : sequence of Information
        All rows of each joint.
    parameter_prior : Information, optional
        Rows of priors on the model's parameters.

    Returns
    -------
    information : Information
        The rows that it was found from.
    weights : ndarray, shape (n,)
        Weight of each joint's rows.

    Raises
    ------
    EstimationError
        If the problem cannot be solved.
    UsageError
        If the noise in the options does not fit the joints.
    """
    weights = joint_weights(joints, problem.options)
    information = _weighted(joints, weights, parameter_prior)
    return solve_consistent(problem, information, standard_prior=standard_prior), information, weights


def _weighted(joints: Sequence[Information], weights: Array, prior: Information | None) -> Information:
    information = weighted(joints, weights)
    if prior is None:
        return information
    return merge([information, prior.scaled(noise_of(information, information.solve()))])


def joint_weights(joints: Sequence[Information], options: ConsistentOptions) -> Array:
    """Return the weight of each joint's rows, shape (n,): by the noise that is given, or by what is left as in `wls`.

    Raises
    ------
    UsageError
        If the noise that is given does not fit the joints.
    """
    if options.noise is None:
        return 1.0 / joint_noise(joints)
    noise = np.asarray(options.noise, dtype=float)
    if noise.shape != (len(joints),) or not np.all(noise > 0.0):
        raise UsageError(f"noise: expected {len(joints)} numbers above 0, one per joint")
    return 1.0 / noise


@one_blas_thread()
def solve_consistent(
    problem: Problem, information: Information, *, standard_prior: StandardPrior | None = None
) -> ConsistentSolution:
    """Find the best possible parameters for one factor; what Monte Carlo and cross-validation repeat.

    Parameters
    ----------
    information : Information
        All rows, weighted, with those of priors on the model's parameters.

    Raises
    ------
    EstimationError
        If the problem cannot be solved.
    """
    u = problem.unknowns
    if standard_prior is None:
        possible = least_squares_arm(problem, information)
        if possible is not None:
            return possible
    point = _best(problem, information, standard_prior)
    margin = u.margin(point.x)
    x = _inside(u, point.x, margin) if margin > -DIGITS else None
    if x is None:
        raise EstimationError(
            f"no physically consistent arm was found (the solution violates its constraints by {-margin:.1g}); record "
            f"a motion with better excitation, check the signs of efforts and positions, or use the method wls, which "
            f"does not require physical consistency"
        )
    return ConsistentSolution(x, u.parameters(x), point)


def least_squares_arm(problem: Problem, information: Information) -> ConsistentSolution | None:
    """Return an arm that plain least squares describes, None where there is none or the solver finds none.

    Raises
    ------
    EstimationError
        If the rows leave parameters undetermined and the problem cannot be solved.
    """
    least_squares = information.solve()
    if least_squares.null.shape[1] == 0:
        x = _determined(problem, least_squares.value)
    else:
        x = _partly_determined(problem, least_squares, _best(problem, information, None))
    return None if x is None else ConsistentSolution(x, problem.unknowns.parameters(x), None)


def _best(problem: Problem, information: Information, standard_prior: StandardPrior | None) -> Point:
    u = problem.unknowns
    noise = noise_of(information, information.solve())
    rows = information.regressor_factor @ u.to_parameters / noise
    target = information.projected_torque / noise
    if standard_prior is not None:
        extra = np.zeros((len(standard_prior.target), u.size))
        extra[:, u.rigid] = standard_prior.rows @ u.nominal.to_standard
        rows, target = np.vstack([rows, extra]), np.concatenate([target, standard_prior.target])
    return problem.solve(rows, target, prior_rows(u, rows, target, problem.options.prior_weight))


@one_blas_thread()
def nearest_arm(
    problem: Problem, information: Information, x: Array, *, standard_prior: StandardPrior | None = None
) -> Array:
    """Find the arm nearest to the nominal one among those that give the same torque.

    Parameters
    ----------
    information : Information
        The rows that x was found from.
    x : ndarray
        See `Unknowns`.
    standard_prior : StandardPrior, optional
        Standard parameters that are known and stay.

    Returns
    -------
    ndarray
        The same in every direction that the rows determine, nearest to nominal in the others.

    Raises
    ------
    EstimationError
        If it is not found.
    """
    u = problem.unknowns
    factor = information.regressor_factor[:, u.place]
    size = np.linalg.norm(factor, axis=0)
    size[size == 0.0] = 1.0
    _, singular, right = np.linalg.svd(factor / size)
    # Fewer rows than parameters leave fewer singular values.
    determined = right[: len(singular)][singular > UNDETERMINED * singular[0]] * size
    rows = [determined @ u.to_parameters[u.place, u.rigid], u.held[:, u.rigid]]
    if standard_prior is not None:
        rows.append(standard_prior.rows @ u.nominal.to_standard)
    result = x.copy()
    unseen = _unseen(np.vstack(rows))
    result[u.rigid] = nearest_to_nominal(x[u.rigid], unseen, u.arm[2 * u.n :], u.nominal.rotor_weights)
    return result


def _unseen(rows: Array) -> Array:
    """Return an orthonormal basis of the directions that rows do not see."""
    from scipy.linalg import null_space

    length = np.linalg.norm(rows, axis=1, keepdims=True)
    return np.asarray(null_space(rows / np.where(length > 0.0, length, 1.0), rcond=DEPENDENT))


def noise_of(information: Information, solution: Solution) -> float:
    """Return the residual of the rows, but no less than a millionth of the torque."""
    return max(information.rms(solution.value), MIN_NOISE_SHARE * information.torque_rms) or 1.0


def _determined(problem: Problem, value: Array) -> Array | None:
    """Return an arm that has these parameters, None where none is found."""
    u = problem.unknowns
    if not _is_allowed(u, value):
        return None
    given = fixed_columns(u, np.arange(u.place.start, u.place.stop), u.sizes(np.zeros(len(value))))
    # The arm nearest to the nominal one may do already.
    x = u.reference.copy()
    x[11 * u.n :] = 0.0
    x = given.corrected(x, value)
    margin = u.margin(x)
    if margin <= ROUNDING:
        found = furthest_inside(u, value, given)
        if not found.possible:
            return None
        x, margin = found.x.copy(), found.margin
    others = u.to_parameters[:, 11 * u.n :]
    column = np.argmax(others != 0.0, axis=0)
    x[11 * u.n :] = value[column] / others[column, np.arange(others.shape[1])]
    return _inside(u, x, margin)


def _is_allowed(u: Unknowns, value: Array) -> bool:
    """Whether friction and the signs of parameters are possible; says nothing of bodies."""
    if np.any(value[u.nonnegative] < 0.0):
        return False
    for polynomial, shape in zip(u.polynomials, u.shapes, strict=True):
        part = value[list(polynomial.columns)]
        if shape != "free" and friction_faults(polynomial, part):
            return False
        if shape == "lubricated" and shape_faults(polynomial, part):
            return False
    return True


def _partly_determined(problem: Problem, least_squares: Solution, point: Point) -> Array | None:
    """Return an arm that explains the rows as well as least squares does, None where none is found.

    What the rows leave open may take any value that makes the rest possible. The solution of the problem is nearest
    to nominal there; where one step from it is no arm, one that is furthest inside is taken.
    """
    from scipy.linalg import null_space

    u = problem.unknowns
    size = u.sizes(least_squares.value)
    given = fixed(u, null_space((least_squares.null / size[:, None]).T, rcond=DEPENDENT).T / size)
    x = given.corrected(point.x, least_squares.value)
    if u.margin(x) > MARGIN and _is_allowed(u, u.parameters(x)):
        return x
    found = furthest_inside(u, least_squares.value, given)
    if not found.possible or not _is_allowed(u, u.parameters(found.x)):
        return None
    return _inside(u, found.x, found.margin)


def _inside(u: Unknowns, x: Array, margin: float) -> Array | None:
    """Move an arm on the boundary, or outside by the solver's tolerance, inside by the margin of all estimates.

    It moves towards the nominal arm by a share of the distance that is no more than margin and tolerance together.
    """
    if margin >= 0.5 * MARGIN:
        return x
    moved = x.copy()
    moved[u.rigid] += (2.0 * MARGIN - margin) * (u.nominal.relative - x[u.rigid])
    return moved if u.margin(moved) > 0.0 else None
