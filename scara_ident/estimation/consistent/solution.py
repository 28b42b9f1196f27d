"""From a triangular factor to the possible arm that explains it best, in two steps.

First the parameters. Where plain least squares belongs to an arm that can exist, it is the answer and no prior pulls
at it. Else the programme finds the best possible arm, with the prior's weak pull so that directions which the data
hardly determine do not follow the noise to the edge of what is possible.

Then what torque cannot tell: with all that it can tell held, the bodies nearest to the nominal ones.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.errors import EstimationError, UsageError
from scara_ident.estimation.consistent.matching import fixed, is_allowed, margin_of, match, sizes
from scara_ident.estimation.consistent.prior import nearest_to_nominal, null_space
from scara_ident.estimation.consistent.programme import MARGIN, Point, Programme
from scara_ident.estimation.consistent.pull import prior_rows
from scara_ident.estimation.consistent.unknowns import Unknowns
from scara_ident.estimation.information import (
    LEAST_NOISE,
    UNDETERMINED,
    Information,
    Solution,
    joint_noise,
    merge,
    weighted,
)
from scara_ident.threads import one_blas_thread

Array = NDArray[np.float64]

# The solver keeps its constraints to so many digits, relative to the nominal bodies.
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
        See `Unknowns`; what torque cannot tell is not yet filled.
    value : ndarray, shape (p,)
        The model's parameters.
    point : Point or None
        What the solver found; None where plain least squares is possible.
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
    programme: Programme,
    joints: Sequence[Information],
    *,
    parameter_prior: Information | None = None,
    standard_prior: StandardPrior | None = None,
) -> tuple[ConsistentSolution, Information, Array]:
    """Find the best possible parameters for the rows of all joints, weighted as the options say.

    Parameters
    ----------
    programme : Programme
    joints : sequence of Information
        All rows of each joint.
    parameter_prior : Information, optional
        Rows of priors on the model's parameters.
    standard_prior : StandardPrior, optional

    Returns
    -------
    solution : ConsistentSolution
    information : Information
        The rows that it was found from.
    weights : ndarray, shape (n,)
        Weight of each joint's rows.

    Raises
    ------
    EstimationError
        If the programme cannot be solved.
    UsageError
        If the noise in the options does not fit the joints.
    """
    options = programme.options
    weights = np.ones(len(joints))
    if options.weighting != "noise":
        information = _weighted(joints, weights, parameter_prior)
        if options.weighting == "equal":
            found = solve_consistent(programme, information, standard_prior=standard_prior)
            return found, information, weights
        possible = None if standard_prior is not None else least_squares_arm(programme, information)
        if possible is not None:
            return possible, information, weights
    weights = 1.0 / _joint_noise(joints, options.noise)
    information = _weighted(joints, weights, parameter_prior)
    return solve_consistent(programme, information, standard_prior=standard_prior), information, weights


def _weighted(joints: Sequence[Information], weights: Array, prior: Information | None) -> Information:
    information = weighted(joints, weights)
    if prior is None:
        return information
    return merge([information, prior.scaled(noise_of(information, information.solve()))])


def _joint_noise(joints: Sequence[Information], given: Array | None) -> Array:
    if given is not None:
        noise = np.asarray(given, dtype=float)
        if noise.shape != (len(joints),) or not np.all(noise > 0.0):
            raise UsageError(f"noise: expected {len(joints)} numbers above 0, one per joint")
        return noise
    return joint_noise(joints)


@one_blas_thread()
def solve_consistent(
    programme: Programme, information: Information, *, standard_prior: StandardPrior | None = None
) -> ConsistentSolution:
    """Find the best possible parameters for one factor; what Monte Carlo and cross-validation repeat.

    Parameters
    ----------
    programme : Programme
    information : Information
        All rows, weighted, with those of priors on the model's parameters.
    standard_prior : StandardPrior, optional

    Returns
    -------
    ConsistentSolution

    Raises
    ------
    EstimationError
        If the programme cannot be solved.
    """
    u = programme.unknowns
    if standard_prior is None:
        possible = least_squares_arm(programme, information)
        if possible is not None:
            return possible
    point = _best(programme, information, standard_prior)
    margin = margin_of(u, point.x)
    x = _inside(u, point.x, margin) if margin > -DIGITS else None
    if x is None:
        raise EstimationError(
            f"the programme's solution misses its constraints by {-margin:.1g}; try richer motion, a larger "
            "prior_weight or wider limits"
        )
    return ConsistentSolution(x, u.parameters(x), point)


def least_squares_arm(programme: Programme, information: Information) -> ConsistentSolution | None:
    """Return an arm that plain least squares describes, None where there is none.

    Parameters
    ----------
    programme : Programme
    information : Information

    Returns
    -------
    ConsistentSolution or None

    Raises
    ------
    EstimationError
        If that cannot be decided.
    """
    least_squares = information.solve()
    if least_squares.null.shape[1] == 0:
        x = _determined(programme, least_squares.value)
    else:
        x = _partly_determined(programme, least_squares, _best(programme, information, None))
    return None if x is None else ConsistentSolution(x, programme.unknowns.parameters(x), None)


def _best(programme: Programme, information: Information, standard_prior: StandardPrior | None) -> Point:
    u = programme.unknowns
    noise = noise_of(information, information.solve())
    rows = information.regressor_factor @ u.to_parameters / noise
    target = information.projected_torque / noise
    if standard_prior is not None:
        extra = np.zeros((len(standard_prior.target), u.size))
        extra[:, u.rigid] = standard_prior.rows @ u.nominal.to_standard
        rows, target = np.vstack([rows, extra]), np.concatenate([target, standard_prior.target])
    return programme.solve_rows(rows, target, prior_rows(u, rows, target, programme.options.prior_weight))


@one_blas_thread()
def fill(
    programme: Programme,
    information: Information,
    x: Array,
    *,
    standard_prior: StandardPrior | None = None,
) -> Array:
    """Fill what torque cannot tell of the bodies from the nominal ones.

    Parameters
    ----------
    programme : Programme
    information : Information
        The rows that x was found from.
    x : ndarray
        See `Unknowns`.
    standard_prior : StandardPrior, optional
        Standard parameters that are known and stay.

    Returns
    -------
    ndarray
        The same arm in all that its rows can tell, nearest to nominal in the rest.

    Raises
    ------
    EstimationError
        If it is not found.
    """
    u = programme.unknowns
    factor = information.regressor_factor[:, u.place]
    size = np.linalg.norm(factor, axis=0)
    size[size == 0.0] = 1.0
    _, singular, right = np.linalg.svd(factor / size)
    seen = singular > UNDETERMINED * singular[0]
    if np.all(seen) and standard_prior is None:
        free = u.unseen
    else:
        rows = [right[seen] * size @ u.to_parameters[u.place, u.rigid], u.held[:, u.rigid]]
        if standard_prior is not None:
            rows.append(standard_prior.rows @ u.nominal.to_standard)
        stacked = np.vstack(rows)
        length = np.linalg.norm(stacked, axis=1, keepdims=True)
        free = null_space(stacked / np.where(length > 0.0, length, 1.0))
    result = x.copy()
    result[u.rigid] = nearest_to_nominal(x[u.rigid], free, u.limits)
    return result


def noise_of(information: Information, solution: Solution) -> float:
    """Return the residual of the rows, but no less than a millionth of the torque."""
    return max(information.rms(solution.value), LEAST_NOISE * information.torque_rms) or 1.0


def _determined(programme: Programme, value: Array) -> Array | None:
    """Return an arm that has these parameters, None where there is none."""
    u = programme.unknowns
    if np.any(value[u.sums] < 0.0) or not is_allowed(u, value, programme.options.friction):
        return None
    found = programme.matcher.find(value)
    return None if found is None else _inside(u, found.x, found.margin)


def _partly_determined(programme: Programme, least_squares: Solution, point: Point) -> Array | None:
    """Return an arm that explains the rows as well as least squares does, None where there is none.

    What the rows leave open may take any value that makes the rest possible. The arm that the programme found is
    nearest to nominal there; where one step from it is no arm, one that is furthest inside is taken.
    """
    u, friction = programme.unknowns, programme.options.friction
    size = sizes(u, least_squares.value)
    what = fixed(u, null_space((least_squares.null / size[:, None]).T).T / size)
    target = np.concatenate([what.combinations @ least_squares.value, np.zeros(len(u.held))])
    x = point.x + what.inverse @ (target - what.rows @ point.x)
    if margin_of(u, x) > MARGIN and is_allowed(u, u.parameters(x), friction):
        return x
    found = match(u, least_squares.value, what)
    if not found.possible or not is_allowed(u, u.parameters(found.x), friction):
        return None
    return _inside(u, found.x, found.margin)


def _inside(u: Unknowns, x: Array, margin: float) -> Array | None:
    """Move an arm at the very edge, or out by the solver's last digits, inside by the margin that all estimates keep.

    It goes towards the nominal arm by a share of the distance that is no more than that margin and those digits.
    """
    if margin >= 0.5 * MARGIN:
        return x
    moved = x.copy()
    moved[u.rigid] += (2.0 * MARGIN - margin) * (u.nominal.relative - x[u.rigid])
    return moved if margin_of(u, moved) > 0.0 else None
