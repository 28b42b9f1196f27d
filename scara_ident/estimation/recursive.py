"""Recursive least squares, as in Indri et al. (2002), in square-root form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.errors import UsageError
from scara_ident.estimation.estimate import Estimate
from scara_ident.estimation.information import Information, merge
from scara_ident.estimation.least_squares import equally, least_squares
from scara_ident.estimation.observations import Observations
from scara_ident.manners import Frozen


@dataclass(frozen=True, eq=False, repr=False)
class History(Frozen):
    """How a recursive estimate came about, block of time by block of time.

    Attributes
    ----------
    samples : ndarray, shape (m,)
        Samples taken in so far.
    value : ndarray, shape (m, p)
        Estimate; NaN as long as a parameter is undetermined.
    std : ndarray, shape (m, p)
        Standard deviation for white residuals of the size seen so far.
    log_det : ndarray, shape (m,)
        J_d so far; -inf as long as a parameter is undetermined.
    """

    samples: Array
    value: Array
    std: Array
    log_det: Array


def rls(
    observations: Observations,
    *,
    prior: Information | None = None,
    forgetting: float = 1.0,
) -> tuple[Estimate, History]:
    """Estimate recursively.

    The recursion of Indri et al. (2002, section 3) in square-root form: the state is the triangular factor, so R_P =
    infinity is exactly the empty factor, and rounding errors stay small. Without prior and
    forgetting the last estimate is that of `ols`.

    Parameters
    ----------
    observations : Observations
        In the order of time.
    prior : Information, optional
        Rows of a prior, see `Information.prior`; default: no prior (R_P = infinity).
    forgetting : float, optional
        Factor per sample on the past information, in (0, 1]; 1 forgets nothing. It acts between blocks of time; within
        a block (about half a second) all samples have the same weight.

    Returns
    -------
    estimate : Estimate
    history : History

    Raises
    ------
    UsageError
        If ``forgetting`` is not in (0, 1].
    """
    if not 0.0 < forgetting <= 1.0:
        raise UsageError(f"forgetting is {forgetting:g}; expected a factor per sample above 0 and up to 1")
    counts = np.mean([joint.counts for joint in observations.joints], axis=0)
    state = prior if prior is not None else Information.empty(observations.parameters)
    value, std, log_det = [], [], []
    for place, count in enumerate(counts):
        state = merge([_faded(state, forgetting**count), *observations.block(place)])
        solution = state.solve()
        value.append(np.where(solution.undetermined, np.nan, solution.value))
        std.append(_white_std(state, solution.value, solution.undetermined))
        log_det.append(-np.inf if np.any(solution.undetermined) else state.log_det())
    history = History(np.cumsum(counts), np.array(value), np.array(std), np.array(log_det))
    if forgetting == 1.0:
        return least_squares(observations, equally, "rls", prior=prior), history
    # What each block still weighs at the end.
    remaining = forgetting ** (np.sum(counts) - np.cumsum(counts))
    remembered = observations.faded(remaining)
    old = None if prior is None else _faded(prior, float(forgetting ** np.sum(counts)))
    return least_squares(remembered, equally, "rls", prior=old), history


def _faded(information: Information, decay: float) -> Information:
    return Information(np.sqrt(decay) * information.factor, decay * information.rows)


def _white_std(state: Information, value: Array, undetermined: NDArray[np.bool_]) -> Array:
    freedom = state.rows - state.parameters
    if freedom <= 0.0:
        return np.full(state.parameters, np.nan)
    variance = state.residual_sum(value) / freedom * np.diag(state.inverse())
    return np.where(undetermined, np.inf, np.sqrt(variance))
