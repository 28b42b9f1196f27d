"""Ordinary and weighted least squares."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.errors import EstimationError, UsageError
from scara_ident.estimation.covariance import block_covariance
from scara_ident.estimation.estimate import Estimate
from scara_ident.estimation.information import Information, joint_noise, merge, residual_noise, weighted
from scara_ident.estimation.noise_bias import noise_bias
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.run_offsets import OffsetRows, beside_offsets, larger_offsets, offsets_on
from scara_ident.estimation.run_variation import MIN_RUNS, RunVariation
from scara_ident.estimation.variation_between import run_variation
from scara_ident.estimation.working_range import DeterminedDirections, determined_directions
from scara_ident.threads import one_blas_thread, side_by_side

# Weights of the joints' rows, shape (n,), from all of them.
Weigh = Callable[[Sequence[Information]], Array]
# Fits beside offsets of runs: how far they lie apart is seen beside the first, where gravity has taken up some of them, and
# beside the second, where it has not.
ROUNDS = 2


def ols(observations: Observations) -> Estimate:
    """Estimate by ordinary least squares: every sample of every joint counts the same.

    Parameters
    ----------
    observations : Observations

    Returns
    -------
    Estimate

    Raises
    ------
    EstimationError
        If there is nothing to estimate from.
    """
    return least_squares(observations, equally, "ols")


def wls(observations: Observations, noise: Array | None = None, least: RunVariation | None = None) -> Estimate:
    """Estimate by least squares with each joint's rows divided by its noise.

    Offsets that differ from run to run count as noise too, see `scara_ident.estimation.run_offsets`.

    Parameters
    ----------
    observations : Observations
    noise : ndarray, shape (n,), optional
        Standard deviation of each joint's torque, from repetitions. Default: each joint's residual within the band,
        computed iteratively, because at first a bad joint increases the residual of the others.
    least : RunVariation, optional
        Smallest differences of the offsets between runs to assume.

    Returns
    -------
    Estimate

    Raises
    ------
    UsageError
        If there is not one noise value for each joint.
    EstimationError
        If there is nothing to estimate from, or a joint's noise is not a positive number.
    """
    if noise is None:
        return least_squares(observations, by_noise, "wls", least=least)
    joints = observations.model.robot.joints
    noise = np.asarray(noise)
    if noise.shape != (len(joints),):
        raise UsageError(f"noise has shape {noise.shape}; expected one number for each of {', '.join(joints)}")
    for joint, sigma in zip(joints, noise, strict=True):
        if not 0.0 < sigma < np.inf:
            raise EstimationError(f"noise of joint {joint} is {sigma:g}; expected a positive number to weigh by")
    return least_squares(observations, lambda _: 1.0 / noise, "wls", least=least)


def equally(joints: Sequence[Information]) -> Array:
    """Return the same weight for all joints, shape (n,)."""
    return np.ones(len(joints))


def by_noise(joints: Sequence[Information]) -> Array:
    """Return each joint's weight from its residual, shape (n,)."""
    return 1.0 / joint_noise(joints)


@dataclass(frozen=True, eq=False)
class _Fit:
    """A solution, and how rows move it.

    Attributes
    ----------
    weights : ndarray, shape (n,)
    value : ndarray, shape (p,)
    undetermined : ndarray of bool, shape (p,)
    inverse : ndarray, shape (p, p)
        Of ``W.T @ W`` of all weighted rows, within the directions that are determined.
    """

    weights: Array
    information: Information
    value: Array
    undetermined: NDArray[np.bool_]
    inverse: Array
    directions: DeterminedDirections | None


def _fit(observations: Observations, weigh: Weigh, method: str, prior: Information | None) -> _Fit:
    """Solve; with weights and without a prior, directions that the data do not determine stay at zero, see `determined_directions`."""
    joints = _joints(observations)
    weights = weigh(joints)
    information = weighted(joints, weights)
    if prior is not None:
        information = merge([information, prior])
    solution = information.solve()
    # With equal weights the result is that of the literature and the paper.
    directions = (
        determined_directions(observations, residual_noise(joints, solution.value))
        if prior is None and method == "wls"
        else None
    )
    if directions is None:
        return _Fit(weights, information, solution.value, solution.undetermined, information.inverse(), None)
    within = directions.within(information)
    inverse = directions.kept @ within.inverse() @ directions.kept.T
    return _Fit(
        weights, information, directions.kept @ within.solve().value, directions.undetermined, inverse, directions
    )


@one_blas_thread()
def least_squares(
    observations: Observations,
    weigh: Weigh,
    method: str,
    prior: Information | None = None,
    least: RunVariation | None = None,
) -> Estimate:
    """Least squares with a weight per joint and, if given, rows of a prior.

    Parameters
    ----------
    weigh : callable
        Returns the weight of each joint's rows, shape (n,), from all of them.
    method : str
        As the estimate is called; of `wls` offsets of runs are noise.
    least : RunVariation, optional
        Smallest differences of the offsets between runs to assume.
    """
    fit, rows = _fit(observations, weigh, method, prior), beside_offsets(observations, None)
    variation, spread = side_by_side(
        lambda work: work(),
        [
            lambda: _variation(observations, fit, rows),
            lambda: block_covariance(fit.inverse, fit.value, observations.joints, observations.owner, fit.weights),
        ],
    )
    if method == "wls" and (variation.offsets or least):
        for _ in range(ROUNDS):
            rows = beside_offsets(observations, larger_offsets(variation.offsets or rows.offsets, least))
            fit = _fit(rows.fitted, weigh, method, prior)
            variation = _variation(observations, fit, rows)
        spread = block_covariance(fit.inverse, fit.value, rows.influence.joints, observations.owner, fit.weights)
    differing = variation if least is None else larger_offsets(variation.offsets, least) or least
    covariance = spread.matrix + differing.covariance(fit.inverse, rows.influence.joints, fit.weights)
    if len(observations.data.recordings) < MIN_RUNS:
        # What else two runs might differ by is not determined.
        variation = variation.offsets or RunVariation((None,) * len(observations.joints))
    bias = None
    if fit.directions is not None:
        covariance += fit.directions.prior
    elif prior is None:
        bias = noise_bias(observations, fit.weights, fit.value if rows.offsets is None else None)
    if bias is not None:
        covariance += np.outer(bias, bias)
    if prior is not None:
        # The prior's own error, which no residual shows.
        precision = prior.regressor_factor.T @ prior.regressor_factor
        covariance += fit.inverse @ precision @ fit.inverse
    covariance[np.diag_indices_from(covariance)] = np.where(fit.undetermined, np.inf, np.diag(covariance))
    return Estimate(
        observations.model,
        method,
        fit.value,
        covariance,
        fit.undetermined,
        fit.information,
        fit.weights,
        spread.kind,
        variation=variation,
        offsets=rows.offsets,
        noise_bias=bias,
    )


def _variation(observations: Observations, fit: _Fit, rows: OffsetRows) -> RunVariation:
    """Return the differences between runs; for files that are too long for the memory, the offsets of the part kept."""
    kept = observations.in_memory
    taken = rows.taken(fit.inverse, fit.weights)
    found = run_variation(kept, kept.joints, fit.value, taken=taken, of_two=True)
    if kept is observations:
        return found
    return offsets_on(observations, found.offsets) or RunVariation((None,) * len(observations.joints))


def weighted_value(joints: Sequence[Information]) -> Array:
    """Return the parameters of `wls` alone, shape (p,), from all rows of each joint."""
    with one_blas_thread():
        return weighted(joints, 1.0 / joint_noise(joints)).solve().value


def value_and_weights(observations: Observations, offsets: RunVariation | None = None) -> tuple[Array, Array]:
    """Return parameters (p,) and joints' weights (n,) of `wls`, without the work of a covariance.

    Parameters
    ----------
    offsets : RunVariation, optional
        Offsets of runs that are noise, see `Estimate.offsets`.
    """
    with one_blas_thread():
        joints = _joints(beside_offsets(observations, offsets).fitted)
        weights = 1.0 / joint_noise(joints)
        return weighted(joints, weights).solve().value, weights


@one_blas_thread()
def determined_value_and_weights(
    observations: Observations, offsets: RunVariation | None = None
) -> tuple[Array, Array]:
    """Return the same, with directions that the data do not determine within the arm's limits at zero, as in `wls`.

    Parameters
    ----------
    offsets : RunVariation, optional
        Offsets of runs that are noise, see `Estimate.offsets`.
    """
    fit = _fit(beside_offsets(observations, offsets).fitted, by_noise, "wls", None)
    return fit.value, fit.weights


def _joints(observations: Observations) -> tuple[Information, ...]:
    """All rows of each joint."""
    if not observations.blocks:
        raise EstimationError("no recording to estimate from")
    return observations.by_joint
