"""Least squares over arms that can exist: physically consistent parameters, bodies and friction."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.consistency.activity import active, tangent
from scara_ident.consistency.bodies import LinkInertia, link_inertia
from scara_ident.consistency.feasibility import Possibility, check_possible
from scara_ident.consistency.matching import fixed, is_allowed, margin_of, match, sizes
from scara_ident.consistency.options import ConsistentOptions
from scara_ident.consistency.prior import nearest_to_nominal, null_space
from scara_ident.consistency.programme import MARGIN, Programme
from scara_ident.consistency.pull import prior_rows
from scara_ident.consistency.unknowns import Unknowns
from scara_ident.covariance import block_covariance
from scara_ident.errors import EstimationError, UsageError
from scara_ident.estimators.estimate import Estimate, pooled_information, weighted_blocks
from scara_ident.estimators.least_squares import ols, residual_noise
from scara_ident.evidence import Evidence
from scara_ident.information import UNDETERMINED, Information, Solution, merge
from scara_ident.model import TorqueModel

Array = NDArray[np.float64]

# Data without noise are not weighted beyond this share of the torque.
LEAST_NOISE = 1e-6
# The solver keeps its constraints to so many digits, relative to the nominal bodies.
DIGITS = 1e-6


@dataclass(frozen=True, eq=False)
class ConsistentEstimate(Estimate):
    """An estimate that belongs to an arm that can exist, and that arm.

    Where plain least squares already belongs to one it is the estimate, and ``std`` is its standard deviation.
    Where constraints hold the estimate, ``std`` is that of the directions in which it can still move: a parameter
    fixed by active constraints has a standard deviation of 0, which says that the constraint and not the data
    determines it. The curvature of the constraints is left out, which makes ``std`` rather too large than too small.

    Attributes
    ----------
    standard : ndarray, shape (11 n,)
        Standard parameters of bodies and rotors, see `Robot.standard_parameters`. They give the estimated base
        parameters to rounding and are nearest to the URDF's in everything else.
    active : tuple of str
        What holds the estimate, such as ``inertia of link2`` or ``friction of joint1``.
    was_possible : bool
        Whether plain least squares was possible, so that nothing had to give.
    notes : tuple of str
        What a person should know, such as nominal bodies that the URDF lacks.
    """

    standard: Array
    active: tuple[str, ...]
    was_possible: bool
    notes: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class ConsistentSolution:
    """Parameters and the arm they belong to, without standard deviations.

    Attributes
    ----------
    x : ndarray
        See `Unknowns`.
    value : ndarray, shape (p,)
    standard : ndarray, shape (11 n,)
    held : ndarray, shape (k, size + auxiliary)
        Directions of the programme's unknowns that active constraints forbid.
    active : tuple of str
    was_possible : bool
    iterations : int
        Of the solver; 0 where plain least squares was possible and only that was found.
    """

    x: Array
    value: Array
    standard: Array
    held: Array
    active: tuple[str, ...]
    was_possible: bool
    iterations: int


def consistent(
    model: TorqueModel,
    evidence: Sequence[Evidence],
    *,
    options: ConsistentOptions | None = None,
    programme: Programme | None = None,
) -> ConsistentEstimate:
    """Estimate by least squares among all arms that can exist.

    Every body has a positive semidefinite pseudo-inertia (Wensing, Kim, Slotine 2018) and every rotor a positive
    inertia; friction takes energy out and can be overcome by the motor; each further term keeps what it declares.
    What torque cannot determine is filled from the nominal bodies (see `nearest_to_nominal`). Where plain least
    squares is possible it is the result; else directions that the data hardly determine are drawn to the nominal
    bodies as well, see ``prior_weight`` of `ConsistentOptions`.

    Parameters
    ----------
    model : TorqueModel
    evidence : sequence of Evidence
        One per recording.
    options : ConsistentOptions, optional
    programme : Programme, optional
        Compiled with the same model and options, to spare compiling it again.

    Returns
    -------
    ConsistentEstimate

    Raises
    ------
    EstimationError
        If there is no evidence or the programme cannot be solved.
    UsageError
        If an option names what the robot or the model does not have.
    """
    if programme is None:
        programme = Programme(model, options)
    options = programme.options
    weights = _weights(model, evidence, options)
    information = pooled_information(evidence, weights)
    noise = noise_of(information, information.solve())
    parameter_prior, standard_prior = _priors(programme.unknowns, options)
    if parameter_prior is not None:
        information = merge([information, parameter_prior.scaled(noise)])
    found = solve_consistent(programme, information, noise, standard_prior)
    solution = information.solve()
    spread = block_covariance(
        _inverse_along(information, tangent(programme.unknowns, found.held), sizes(programme.unknowns, found.value)),
        found.value,
        weighted_blocks(evidence, weights),
    )
    covariance = spread.matrix.copy()
    covariance[np.diag_indices_from(covariance)] = np.where(solution.undetermined, np.inf, np.diag(covariance))
    return ConsistentEstimate(
        model=model,
        method="consistent",
        value=found.value,
        covariance=covariance,
        undetermined=solution.undetermined,
        information=information,
        weights=weights,
        std_kind=spread.kind,
        standard=found.standard,
        active=found.active,
        was_possible=found.was_possible,
        notes=_notes(programme.unknowns, options, found, covariance),
    )


def solve_consistent(
    programme: Programme,
    information: Information,
    noise: float | None = None,
    standard_prior: tuple[Array, Array] | None = None,
) -> ConsistentSolution:
    """Solve for one factor; what repeated solves (Monte Carlo, cross-validation) call.

    Parameters
    ----------
    programme : Programme
    information : Information
        All rows, weighted, with those of priors on the model's parameters.
    noise : float, optional
        Standard deviation of the rows; by default their residual.
    standard_prior : (ndarray, ndarray), optional
        Rows on the standard parameters and their right-hand side, each divided by its standard deviation.

    Returns
    -------
    ConsistentSolution

    Raises
    ------
    EstimationError
        If the programme cannot be solved.
    """
    u = programme.unknowns
    solution = information.solve()
    noise = noise_of(information, solution) if noise is None else noise
    if standard_prior is None:
        matched = _if_possible(programme, solution)
        if matched is not None:
            x = _filled(u, matched, information, solution, np.zeros((0, 11 * u.n)))
            nothing = np.zeros((0, u.size + u.auxiliary))
            return ConsistentSolution(x, u.parameters(x), u.standard(x), nothing, (), True, 0)
    rows = information.regressor_factor @ u.to_parameters / noise
    target = information.projected_torque / noise
    if standard_prior is not None:
        extra = np.zeros((len(standard_prior[1]), u.size))
        extra[:, u.rigid] = standard_prior[0] @ u.nominal.to_standard
        rows, target = np.vstack([rows, extra]), np.concatenate([target, standard_prior[1]])
        known = extra[:, u.rigid]
    else:
        known = np.zeros((0, 11 * u.n))
    prior = prior_rows(u, rows, target, programme.options.prior_weight)
    point = programme.solve_rows(rows, target, prior)
    held, labels = active(u, point)
    margin = margin_of(u, point.x)
    inside = _inside(u, point.x, margin) if margin > -DIGITS else None
    if inside is None:
        raise EstimationError(
            f"the programme's solution misses its constraints by {-margin:.1g}; try richer motion, a larger "
            "prior_weight or wider limits"
        )
    x = _filled(u, inside, information, solution, known)
    return ConsistentSolution(x, u.parameters(x), u.standard(x), held, labels, False, point.iterations)


def links(estimate: ConsistentEstimate) -> tuple[LinkInertia, ...]:
    """Return mass, centre of mass and inertia of every identified link.

    Parameters
    ----------
    estimate : ConsistentEstimate

    Returns
    -------
    tuple of LinkInertia
        In the order of the robot's joints; a link includes what is fixed or locked to it.
    """
    robot = estimate.model.robot
    bodies = estimate.standard[: 10 * robot.n].reshape(robot.n, 10)
    return tuple(link_inertia(name, body) for name, body in zip(robot.links, bodies, strict=True))


def possibility(estimate: Estimate) -> Possibility:
    """Say whether an arm with the estimated parameters can exist, for any method.

    Parameters
    ----------
    estimate : Estimate

    Returns
    -------
    Possibility
    """
    return check_possible(estimate.model, estimate.value, information=estimate.information)


def noise_of(information: Information, solution: Solution) -> float:
    """Return the residual of the rows, but no less than a millionth of the torque."""
    return max(information.rms(solution.value), LEAST_NOISE * information.torque_rms) or 1.0


def _weights(model: TorqueModel, evidence: Sequence[Evidence], options: ConsistentOptions) -> Array:
    if options.weighting == "equal":
        return np.ones(model.robot.n)
    noise = residual_noise(ols(model, evidence), evidence) if options.noise is None else np.asarray(options.noise)
    if noise.shape != (model.robot.n,) or not np.all(noise > 0.0):
        raise UsageError(f"noise: expected {model.robot.n} numbers above 0, one per joint")
    return 1.0 / noise


def _priors(u: Unknowns, options: ConsistentOptions) -> tuple[Information | None, tuple[Array, Array] | None]:
    """Sort the user's priors into those on the model's parameters and those on standard parameters."""
    if not options.priors:
        return None, None
    names, standard_names = u.model.names, u.model.rigid_body.base.standard_names
    mean, std = np.zeros(len(names)), np.full(len(names), np.inf)
    rows, target = [], []
    for name, (value, spread) in options.priors.items():
        if name in names:
            mean[names.index(name)], std[names.index(name)] = value, spread
        elif name in standard_names:
            rows.append(np.eye(len(standard_names))[standard_names.index(name)] / spread)
            target.append(value / spread)
        else:
            raise UsageError(
                f"prior of {name!r}: neither a parameter of the model ({', '.join(names)}) nor a standard parameter "
                f"({', '.join(standard_names[:10])}, ...)"
            )
    on_model = Information.prior(mean, std) if np.any(np.isfinite(std)) else None
    return on_model, (np.array(rows), np.array(target)) if rows else None


def _if_possible(programme: Programme, solution: Solution) -> Array | None:
    """Return an arm that has the least-squares parameters, None where there is none."""
    u, value = programme.unknowns, solution.value
    if solution.null.shape[1] == 0:
        if np.any(value[u.sums] < 0.0) or not is_allowed(u, value, programme.options.friction):
            return None
        found = programme.matcher.find(value)
        return None if found is None else _inside(u, found.x, found.margin)
    # What the data leave open may take any value that makes the rest possible.
    size = sizes(u, value)
    combinations = null_space((solution.null / size[:, None]).T).T / size
    found = match(u, value, fixed(u, combinations))
    if not found.possible or not is_allowed(u, u.parameters(found.x), programme.options.friction):
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


def _filled(u: Unknowns, x: Array, information: Information, solution: Solution, known: Array) -> Array:
    """Fill what torque cannot tell of the bodies from the nominal ones; all else stays."""
    result = x.copy()
    if solution.null.shape[1] == 0 and len(known) == 0:
        free = u.unseen
    else:
        factor = information.regressor_factor[:, u.place]
        size = np.linalg.norm(factor, axis=0)
        size[size == 0.0] = 1.0
        _, singular, right = np.linalg.svd(factor / size)
        rows = right[singular > UNDETERMINED * singular[0]] * size @ u.to_parameters[u.place, u.rigid]
        free = null_space(_unit_rows(np.vstack([rows, u.held[:, u.rigid], known])))
    result[u.rigid] = nearest_to_nominal(x[u.rigid], free, u.limits)
    return result


def _unit_rows(rows: Array) -> Array:
    size = np.linalg.norm(rows, axis=1, keepdims=True)
    return rows / np.where(size > 0.0, size, 1.0)


def _inverse_along(information: Information, directions: Array, size: Array) -> Array:
    """Inverse of ``W.T @ W`` on the determined part of the directions, shape (p, p)."""
    left, singular, _ = np.linalg.svd(directions / size[:, None], full_matrices=False)
    basis = size[:, None] * left[:, singular > 1e-9 * singular[0]] if singular.size else np.zeros((len(size), 0))
    seen = information.regressor_factor @ basis
    length = np.linalg.norm(seen, axis=0)
    basis, seen = basis[:, length > 0.0] / length[length > 0.0], seen[:, length > 0.0] / length[length > 0.0]
    if not seen.shape[1]:
        return np.zeros((len(size), len(size)))
    _, singular, right = np.linalg.svd(seen, full_matrices=False)
    known = singular > UNDETERMINED * singular[0]
    half = basis @ (right[known].T / singular[known])
    return np.asarray(half @ half.T)


def _notes(u: Unknowns, options: ConsistentOptions, found: ConsistentSolution, covariance: Array) -> tuple[str, ...]:
    notes = list(u.nominal.notes)
    if options.friction != "free":
        slow = [p.joint for p in u.polynomials if not np.isfinite(p.speed)]
        if slow:
            notes.append(
                f"{', '.join(slow)}: no velocity limit is known; friction takes energy out at every speed, and the "
                "motor's limit is not used"
            )
    if found.active:
        notes.append(f"held by what an arm can have: {', '.join(found.active)}")
    moved = MARGIN * sizes(u, found.value)
    std = np.sqrt(np.clip(np.diag(covariance), 0.0, None))
    if found.active and np.any((std > 0.0) & (moved > 0.1 * std)):
        notes.append(
            f"the data are so good that the distance of {MARGIN:g} kept from bodies without extent is more than a "
            "tenth of a standard deviation"
        )
    return tuple(notes)
