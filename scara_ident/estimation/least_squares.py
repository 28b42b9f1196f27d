"""Ordinary and weighted least squares."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import EstimationError, UsageError
from scara_ident.estimation.covariance import block_covariance
from scara_ident.estimation.estimate import Estimate
from scara_ident.estimation.information import Information, joint_noise, merge, residual_noise, weighted
from scara_ident.estimation.noise_bias import noise_bias
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.run_variation import LEAST_RUNS, RunVariation, run_variation
from scara_ident.estimation.working_range import told_directions
from scara_ident.threads import one_blas_thread, side_by_side


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
    return least_squares(observations, np.ones(len(observations.joints)), "ols")


def wls(observations: Observations, noise: Array | None = None) -> Estimate:
    """Estimate by least squares with each joint's rows divided by its noise.

    Parameters
    ----------
    observations : Observations
    noise : ndarray, shape (n,), optional
        Standard deviation of each joint's torque, from repetitions; by default each joint's residual within the band,
        in rounds: at first a bad joint spoils the good one's.

    Returns
    -------
    Estimate

    Raises
    ------
    UsageError
        If there is not one number of noise for each joint.
    EstimationError
        If there is nothing to estimate from, or a joint's noise is not a positive number.
    """
    if noise is None:
        with one_blas_thread():
            return least_squares(observations, 1.0 / joint_noise(_joints(observations)), "wls")
    joints = observations.model.robot.joints
    noise = np.asarray(noise)
    if noise.shape != (len(joints),):
        raise UsageError(f"noise has shape {noise.shape}; expected one number for each of {', '.join(joints)}")
    for joint, sigma in zip(joints, noise, strict=True):
        if not 0.0 < sigma < np.inf:
            raise EstimationError(f"noise of joint {joint} is {sigma:g}; expected a positive number to weigh by")
    return least_squares(observations, 1.0 / noise, "wls")


@one_blas_thread()
def least_squares(
    observations: Observations, weights: Array, method: str, prior: Information | None = None
) -> Estimate:
    """Least squares with a weight per joint and, if given, rows of a prior.

    With weights and without a prior, what data leave open of the torque within the arm's limits is left at zero, see
    `told_directions`.
    """
    information = weighted(_joints(observations), weights)
    if prior is not None:
        information = merge([information, prior])
    solution = information.solve()
    value, undetermined, inverse = solution.value, solution.undetermined, information.inverse()
    # Equal weights stay what they are in the literature, the paper's among it.
    told = (
        told_directions(observations, residual_noise(observations.by_joint, value))
        if prior is None and method == "wls"
        else None
    )
    if told is not None:
        within = told.within(information)
        value, undetermined = told.kept @ within.solve().value, told.undetermined
        inverse = told.kept @ within.inverse() @ told.kept.T
    variation, spread = side_by_side(
        lambda work: work(),
        [
            lambda: run_variation(observations, observations.joints, value, of_two=True),
            lambda: block_covariance(inverse, value, observations.joints, observations.owner, weights),
        ],
    )
    covariance = spread.matrix + variation.covariance(inverse, observations.joints, weights)
    if len(observations.data.recordings) < LEAST_RUNS:
        # What else two runs might differ by is not told, and nothing is said of it.
        variation = RunVariation((None,) * len(observations.joints))
    bias = None
    if told is not None:
        covariance += told.prior
    elif prior is None:
        bias = noise_bias(observations, weights, value)
    if bias is not None:
        covariance += np.outer(bias, bias)
    if prior is not None:
        # The prior's own error, which no residual shows.
        precision = prior.regressor_factor.T @ prior.regressor_factor
        covariance += inverse @ precision @ inverse
    covariance[np.diag_indices_from(covariance)] = np.where(undetermined, np.inf, np.diag(covariance))
    return Estimate(
        observations.model,
        method,
        value,
        covariance,
        undetermined,
        information,
        weights,
        spread.kind,
        variation=variation,
        noise_bias=bias,
    )


def weighted_value(joints: Sequence[Information]) -> Array:
    """Return the parameters of `wls` alone, shape (p,), from all rows of each joint."""
    with one_blas_thread():
        return weighted(joints, 1.0 / joint_noise(joints)).solve().value


def value_and_weights(observations: Observations) -> tuple[Array, Array]:
    """Return parameters (p,) and joints' weights (n,) of `wls`, without the work of a covariance."""
    with one_blas_thread():
        joints = _joints(observations)
        weights = 1.0 / joint_noise(joints)
        return weighted(joints, weights).solve().value, weights


@one_blas_thread()
def told_value_and_weights(observations: Observations) -> tuple[Array, Array]:
    """Return the same with what data leave open of the torque within the arm's limits at zero, as `wls` leaves it."""
    value, weights = value_and_weights(observations)
    told = told_directions(observations, residual_noise(observations.by_joint, value))
    if told is not None:
        value = told.kept @ told.within(weighted(_joints(observations), weights)).solve().value
    return value, weights


def _joints(observations: Observations) -> tuple[Information, ...]:
    """All rows of each joint."""
    if not observations.blocks:
        raise EstimationError("no recording to estimate from")
    return observations.by_joint
