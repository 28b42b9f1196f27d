"""Least squares over arms that can exist: physically consistent parameters, bodies and friction."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import EstimationError, UsageError
from scara_ident.estimation.consistent.bodies import LinkInertia, link_inertia
from scara_ident.estimation.consistent.constraints import active_set
from scara_ident.estimation.consistent.feasibility import PhysicalConsistency, check_consistency
from scara_ident.estimation.consistent.friction import as_recorded
from scara_ident.estimation.consistent.options import ConsistentOptions
from scara_ident.estimation.consistent.problem import (
    DEPENDENT,
    MARGIN,
    Problem,
    Unknowns,
    declared,
)
from scara_ident.estimation.consistent.shape import ShapeChoice, choose_shapes
from scara_ident.estimation.consistent.solution import (
    ConsistentSolution,
    StandardPrior,
    joint_weights,
    nearest_arm,
    solve_joints,
)
from scara_ident.estimation.covariance import block_covariance
from scara_ident.estimation.estimate import Estimate
from scara_ident.estimation.information import UNDETERMINED, Information
from scara_ident.estimation.least_squares import least_squares
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.run_offsets import OffsetRows, beside_offsets
from scara_ident.estimation.variation_between import run_variation
from scara_ident.threads import one_blas_thread

__all__ = ["ConsistentEstimate", "ConsistentOptions", "consistent", "links", "physical_consistency"]

# Directions that active constraints allow by less than this are what the solver's digits leave of forbidden ones.
DIGITS = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class ConsistentEstimate(Estimate):
    """A physically consistent estimate, and the arm that has it.

    If weighted least squares is already physically consistent, it is the estimate, and ``std`` is its standard
    deviation. If constraints are active, ``std`` is that of the directions in which the estimate can still move, plus
    the part of the unconstrained standard deviation that the data leave beyond the constraints. The curvature of the
    constraints is neglected, so ``std`` is rather too large than too small.

    Attributes
    ----------
    standard : ndarray, shape (11 n,)
        Standard parameters of bodies and rotors, see `Robot.standard_parameters`. They give the estimated base
        parameters up to rounding; in everything else they are as near to the URDF's as possible.
    active : tuple of str
        Active constraints, such as ``inertia of link2`` or ``friction of joint1``.
    was_possible : bool
        Whether least squares without constraints was physically consistent and is the estimate.
    shapes : tuple of ShapeChoice
        The constraint on the friction of each joint, and the reason.
    notes : tuple of str
        Remarks for the user, such as nominal bodies that the URDF lacks.
    """

    standard: Array
    active: tuple[str, ...]
    was_possible: bool
    shapes: tuple[ShapeChoice, ...]
    notes: tuple[str, ...]


@one_blas_thread()
def consistent(observations: Observations, *, options: ConsistentOptions | None = None) -> ConsistentEstimate:
    """Estimate by least squares among all physically consistent parameters.

    Every body has a positive semidefinite pseudo-inertia (Wensing, Kim, Slotine 2018) and every rotor a positive
    inertia; friction dissipates energy, can be overcome by the motor, and grows less and less with speed if the data do
    not contradict that (see `choose_shapes`); other terms keep the constraints that they declare. Every joint's rows
    are divided by its residual, as in `wls`. If the result of `wls` is physically consistent, it is the result.
    Otherwise a prior on the nominal bodies acts on directions that the data hardly determine, see ``prior_weight`` of
    `ConsistentOptions`. Of all standard parameters that have the estimated base parameters, those nearest to the
    nominal bodies are chosen (see `nearest_to_nominal`).

    Parameters
    ----------
    observations : Observations
    options : ConsistentOptions, optional

    Returns
    -------
    ConsistentEstimate

    Raises
    ------
    EstimationError
        If there is no recording, or the problem cannot be solved.
    UsageError
        If an option names something that the robot or the model does not have.

    Examples
    --------
    >>> from scara_ident import build_model, consistent, load_robot, named_motion, observe, prepare, simulate, virtual_arm
    >>> robot = load_robot()
    >>> run = simulate(virtual_arm(robot), named_motion("OJK", robot), rate=250.0)
    >>> observations = observe(build_model(robot), prepare([run.recording], bands=[20.0, 20.0]))
    >>> consistent(observations)
    ConsistentEstimate(scara03, complete by consistent: 15 parameters)
    """
    model = observations.model
    options = options or ConsistentOptions()
    if not observations.blocks:
        raise EstimationError("no recording to estimate from")
    plain = least_squares(observations, lambda joints: joint_weights(joints, options), "wls")
    rows = beside_offsets(observations, plain.offsets)
    polynomials = [
        as_recorded(each, plain.information.regressor_factor, plain.value) for each in declared(model, options)[1]
    ]
    shapes = choose_shapes(polynomials, options, observations, plain)
    problem = Problem(model, replace(options, friction={choice.joint: choice.shape for choice in shapes}), polynomials)
    u = problem.unknowns
    parameter_prior, standard_prior = _priors(u, options)
    found, information, weights = solve_joints(
        problem, rows.fitted.by_joint, parameter_prior=parameter_prior, standard_prior=standard_prior
    )
    x = nearest_arm(problem, information, found.x, standard_prior=standard_prior)
    return _estimate(problem, observations, rows, information, weights, plain, found, x, shapes)


def _estimate(
    problem: Problem,
    observations: Observations,
    rows: OffsetRows,
    information: Information,
    weights: Array,
    plain: Estimate,
    found: ConsistentSolution,
    x: Array,
    shapes: tuple[ShapeChoice, ...],
) -> ConsistentEstimate:
    u = problem.unknowns
    value = u.parameters(x)
    free, labels = _free_directions(u, found)
    sizes = u.sizes(value)
    along = _half_along(information, free, sizes)
    inverse = along @ along.T
    spread = block_covariance(inverse, value, rows.influence.joints, observations.owner, weights)
    undetermined = information.solve().undetermined
    variation = run_variation(observations, observations.joints, value, taken=rows.taken(inverse, weights))
    covariance = spread.matrix + variation.covariance(inverse, rows.influence.joints, weights)
    bias = None
    if plain.noise_bias is not None:
        # As far as constraints let the noise of the positions move the estimate.
        bias = inverse @ (
            plain.information.regressor_factor.T @ (plain.information.regressor_factor @ plain.noise_bias)
        )
        covariance += np.outer(bias, bias)
    covariance = _beyond_constraints(
        covariance, plain.covariance, _apart(value - plain.value, plain.covariance, along, sizes)
    )
    covariance[np.diag_indices_from(covariance)] = np.where(undetermined, np.inf, np.diag(covariance))
    return ConsistentEstimate(
        model=observations.model,
        method="consistent",
        value=value,
        covariance=covariance,
        undetermined=undetermined,
        information=information,
        weights=weights,
        std_kind=spread.kind,
        standard=u.standard(x),
        active=labels,
        was_possible=found.was_possible,
        shapes=shapes,
        notes=_notes(u, labels, value, covariance),
        variation=variation,
        offsets=plain.offsets,
        noise_bias=bias,
    )


def links(estimate: ConsistentEstimate) -> tuple[LinkInertia, ...]:
    """Return mass, centre of mass and inertia of every identified link.

    Returns
    -------
    tuple of LinkInertia
        In the order of the robot's joints; a link includes what is fixed or locked to it.
    """
    robot = estimate.model.robot
    bodies = estimate.standard[: 10 * robot.n].reshape(robot.n, 10)
    return tuple(link_inertia(name, body) for name, body in zip(robot.links, bodies, strict=True))


def physical_consistency(estimate: Estimate) -> PhysicalConsistency:
    """Say whether an arm with the estimated parameters can exist, for any method."""
    return check_consistency(estimate.model, estimate.value, information=estimate.information)


def _priors(u: Unknowns, options: ConsistentOptions) -> tuple[Information | None, StandardPrior | None]:
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
    return on_model, StandardPrior(np.array(rows), np.array(target)) if rows else None


def _free_directions(u: Unknowns, found: ConsistentSolution) -> tuple[Array, tuple[str, ...]]:
    """Return the directions in which the parameters can still move, shape (p, k), and what is active."""
    from scipy.linalg import null_space

    # As long as what they are about: columns of no unit of their own are in 1 N m, also where torques are of millions.
    length = np.ones(u.size)
    length[u.rigid.stop :] = np.maximum(1.0, np.abs(found.x[u.rigid.stop :]))
    free, labels = np.diag(length), tuple[str, ...]()
    if found.point is not None:
        whole = np.concatenate([found.point.x, found.point.auxiliary])
        rows, labels = active_set(u.cones, whole, found.point.multipliers)
        whole_length = np.concatenate([length, np.ones(len(found.point.auxiliary))])
        free = length[:, None] * null_space(rows * whole_length, rcond=DEPENDENT)[: u.size]
    if len(u.held):
        free = free @ null_space(u.held @ free, rcond=DEPENDENT)
    return u.to_parameters @ free, labels


def _apart(moved: Array, plain: Array, along: Array, size: Array) -> float | None:
    """Return by how many standard deviations, squared, data lie beyond a constraint in the mean over these; None where nothing holds.

    Standard deviations are those of the data, noise that remembers and runs that differ counted: by white noise, in whose metric
    the fit is made, data would lie the further beyond the more of either there is.

    Parameters
    ----------
    moved : ndarray, shape (p,)
        From the estimate of the data alone.
    plain : ndarray, shape (p, p)
        Covariance of the data alone; infinite variances where they leave a parameter open.
    along : ndarray, shape (p, k)
        Directions in which the parameters can still move.
    size : ndarray, shape (p,)
        Of the parameters, as a unit of each.
    """
    from scipy.linalg import null_space, pinvh

    known = np.isfinite(np.diag(plain))
    across = null_space((along / size[:, None])[known].T) / size[known, None]
    if not across.shape[1]:
        return None
    step = across.T @ moved[known]
    spread = across.T @ plain[np.ix_(known, known)] @ across
    return float(step @ pinvh(spread) @ step / len(step))


def _beyond_constraints(covariance: Array, plain: Array, apart: float | None) -> Array:
    """Return the covariance with what data leave open across the constraints that hold them.

    Had data been others, a constraint would not have held them, or another would: what is found on it is no more sure for it
    than the constraint is strong. What is known of a parameter that data put so far beyond a bound, on the other side
    of it, is the tail of their normal distribution, whose mean square about the bound is the share of their variance that stays.

    Parameters
    ----------
    covariance : ndarray, shape (p, p)
        Along the constraints.
    plain : ndarray, shape (p, p)
        Of the data alone; infinite variances where they leave a parameter open.
    apart : float or None
        By how many standard deviations, squared, the data lie beyond a constraint in the mean over these, see `_apart`.
    """
    from scipy.special import log_ndtr

    if apart is None:
        return covariance
    beyond = np.sqrt(apart)
    tail = float(np.exp(-0.5 * apart - log_ndtr(-beyond)) / np.sqrt(2.0 * np.pi))
    share = float(np.clip(1.0 + apart - beyond * tail, 0.0, 1.0))
    known = np.isfinite(np.diag(plain)) & np.isfinite(np.diag(covariance))
    found = covariance.copy()
    own = np.ix_(known, known)
    found[own] += share * (plain[own] - covariance[own])
    return found


def _half_along(information: Information, directions: Array, size: Array) -> Array:
    """Return a root of the inverse of ``W.T @ W`` on the determined part of the directions, shape (p, k)."""
    left, singular, _ = np.linalg.svd(directions / size[:, None], full_matrices=False)
    basis = size[:, None] * left[:, singular > DIGITS * singular[0]] if singular.size else np.zeros((len(size), 0))
    seen = information.regressor_factor @ basis
    length = np.linalg.norm(seen, axis=0)
    basis, seen = basis[:, length > 0.0] / length[length > 0.0], seen[:, length > 0.0] / length[length > 0.0]
    if not seen.shape[1]:
        return np.zeros((len(size), 0))
    _, singular, right = np.linalg.svd(seen, full_matrices=False)
    known = singular > UNDETERMINED * singular[0]
    return np.asarray(basis @ (right[known].T / singular[known]))


def _notes(u: Unknowns, active: tuple[str, ...], value: Array, covariance: Array) -> tuple[str, ...]:
    notes = list(u.nominal.notes)
    held = [p for p, shape in zip(u.polynomials, u.shapes, strict=True) if shape != "free"]
    slow = [p.joint for p in held if not np.isfinite(p.speed)]
    if slow:
        notes.append(
            f"{', '.join(slow)}: no velocity limit is known; friction dissipates energy at every speed, and the "
            f"motor's limit is not used"
        )
    if active:
        notes.append(f"limited by physical consistency: {', '.join(active)}")
    moved = MARGIN * u.sizes(value)
    std = np.sqrt(np.clip(np.diag(covariance), 0.0, None))
    if active and np.any((std > 0.0) & (moved > 0.1 * std)):
        notes.append(
            f"the data are so precise that the minimum extent of bodies, {MARGIN:g}, changes parameters by more than a "
            f"tenth of a standard deviation"
        )
    return tuple(notes)
