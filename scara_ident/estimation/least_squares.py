"""Ordinary and weighted least squares."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scara_ident.errors import EstimationError
from scara_ident.estimation.covariance import block_covariance
from scara_ident.estimation.estimate import Estimate, pooled_information, weighted_blocks
from scara_ident.estimation.information import Information, joint_noise, merge, weighted
from scara_ident.estimation.observations import Evidence
from scara_ident.model.model import TorqueModel
from scara_ident.threads import one_blas_thread

Array = NDArray[np.float64]


def ols(model: TorqueModel, evidence: Sequence[Evidence]) -> Estimate:
    """Estimate by ordinary least squares: every sample of every joint counts the same.

    Parameters
    ----------
    model : TorqueModel
    evidence : sequence of Evidence
        One per recording.

    Returns
    -------
    Estimate

    Raises
    ------
    EstimationError
        If there is no evidence.
    """
    return least_squares(model, evidence, np.ones(model.robot.n), "ols")


def wls(model: TorqueModel, evidence: Sequence[Evidence], noise: Array | None = None) -> Estimate:
    """Estimate by least squares with each joint's rows divided by its noise.

    Parameters
    ----------
    model : TorqueModel
    evidence : sequence of Evidence
    noise : ndarray, shape (n,), optional
        Standard deviation of each joint's torque, from repetitions; by default each joint's residual within the band,
        in rounds: at first a bad joint spoils the good one's.

    Returns
    -------
    Estimate

    Raises
    ------
    EstimationError
        If there is no evidence, or a joint's noise is not a positive number.
    """
    if noise is None:
        with one_blas_thread():
            return least_squares(model, evidence, 1.0 / joint_noise(_joints(model, evidence)), "wls")
    for joint, sigma in zip(model.robot.joints, noise, strict=True):
        if not 0.0 < sigma < np.inf:
            raise EstimationError(f"noise of joint {joint} is {sigma:g}; expected a positive number to weigh by")
    return least_squares(model, evidence, 1.0 / noise, "wls")


def least_squares(
    model: TorqueModel, evidence: Sequence[Evidence], weights: Array, method: str, prior: Information | None = None
) -> Estimate:
    """Least squares with a weight per joint and, if given, rows of a prior."""
    information = pooled_information(evidence, weights)
    if prior is not None:
        information = merge([information, prior])
    solution = information.solve()
    inverse = information.inverse()
    spread = block_covariance(inverse, solution.value, weighted_blocks(evidence, weights))
    covariance = spread.matrix.copy()
    if prior is not None:
        # The prior's own error, which no residual shows.
        precision = prior.regressor_factor.T @ prior.regressor_factor
        covariance += inverse @ precision @ inverse
    covariance[np.diag_indices_from(covariance)] = np.where(solution.undetermined, np.inf, np.diag(covariance))
    return Estimate(model, method, solution.value, covariance, solution.undetermined, information, weights, spread.kind)


def weighted_value(model: TorqueModel, evidence: Sequence[Evidence]) -> Array:
    """Return the parameters of `wls` alone, shape (p,), without the work of their covariance."""
    with one_blas_thread():
        joints = _joints(model, evidence)
        return weighted(joints, 1.0 / joint_noise(joints)).solve().value


def _joints(model: TorqueModel, evidence: Sequence[Evidence]) -> list[Information]:
    """All rows of each joint."""
    if not evidence:
        raise EstimationError("no recording to estimate from")
    return [merge(item.joint(j) for item in evidence) for j in range(model.robot.n)]
