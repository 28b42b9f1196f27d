"""A second test, by rows with autocorrelated errors, for candidates that remove nearly all of the residual.

Blocks of time are few, and a column that lives in some of them leaves `cluster_test` hardly any freedom: a cubic term of
the torque that removes nine tenths of the residual may then pass for chance. What is left beside such a candidate is
near the noise, so that it shows how far the noise remembers; if that is less than a block, the rows themselves are counted,
with the heteroscedastic and autocorrelation-consistent covariance of Newey and West (1987) over that memory, and Satterthwaite's
degrees of freedom. With two tests the smaller probability counts twice (Bonferroni).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Rows
from scara_ident.diagnosis.testing.candidate_tests import Examination
from scara_ident.diagnosis.testing.cluster_test import significance
from scara_ident.diagnosis.testing.fitted_model import FittedModel

# The noise is forgotten where its autocorrelation first falls below this.
FORGOTTEN = 0.1
# Longest memory that is looked for, as a share of a joint's rows.
MAX_MEMORY_SHARE = 0.25
# Of a block, within which what is left on a candidate's joints must be forgotten for rows to be counted: their level was
# shown for noise that is. What is remembered longer is no noise, but something that is still missing.
NOISE_WITHIN = 0.5


def examine_rows(model: FittedModel, candidate: Rows, found: Examination) -> Examination:
    """Return an examination with the more powerful of both tests.

    Parameters
    ----------
    candidate : mapping of int to ndarray, shape (k, N)
        Its columns on the rows of every joint that it acts on.
    found : Examination
        Of the candidate, with the test by blocks.

    Returns
    -------
    Examination
        Its ``p_value`` holds for both tests together; covariance and freedom are of the smaller one.
    """
    covariance, freedom = _by_rows(model, candidate, found)
    p_value = significance(found.value, covariance, freedom, found.products)
    together = min(1.0, 2.0 * min(p_value, found.p_value))
    if p_value >= found.p_value:
        return replace(found, p_value=together)
    return replace(found, p_value=together, tested=found.value, covariance=covariance, freedom=freedom)


def _by_rows(model: FittedModel, candidate: Rows, found: Examination) -> tuple[Array, float]:
    """Return the covariance of a candidate's coefficients from single rows, and its degrees of freedom."""
    weighted = {joint: model.weights[joint] * columns for joint, columns in candidate.items()}
    sums = np.sum([model.sums(joint, columns) for joint, columns in weighted.items()], axis=0)
    scatter = np.zeros_like(found.products)
    trace = norm = own = remembered = 0.0
    rows = sum(len(residual) for residual in model.residual)
    for joint, residual in enumerate(model.residual):
        outside = weighted.get(joint, 0.0) - sums @ model.basis(joint)
        along = found.value @ outside
        left = residual - along
        if not np.any(left) or not np.any(along):
            continue
        lags = _memory(left)
        scores, squares = outside * left, along**2
        kurtosis = float(np.mean(left**4) / np.mean(left**2) ** 2)
        scatter += scores @ scores.T
        trace += float(np.sum(squares))
        norm += 0.5 * max(2.0, kurtosis - 1.0) * float(squares @ squares)
        if joint in weighted:
            own += float(np.sum(squares))
            remembered += float(np.sum(squares)) * 0.5 * lags * len(model.fold) / len(left)
        for lag in range(1, lags + 1):
            weight = 1.0 - lag / (lags + 1.0)
            across = weight * scores[:, lag:] @ scores[:, :-lag].T
            scatter += across + across.T
            norm += 2.0 * weight**2 * float(squares[lag:] @ squares[:-lag])
    spare = rows - model.root.shape[1] - len(found.value)
    if spare <= 0 or norm == 0.0 or remembered > NOISE_WITHIN * own:
        return np.full_like(scatter, np.inf), 1.0
    inverse = np.linalg.pinv(found.products, rcond=1e-9, hermitian=True)
    return rows / spare * inverse @ scatter @ inverse, min(trace**2 / norm, float(spare))


def _memory(left: Array) -> int:
    """Return over how many rows a residual remembers: twice the lag at which its autocorrelation has fallen."""
    count = len(left)
    power = np.abs(np.fft.rfft(left, 2 * count)) ** 2
    correlation = np.fft.irfft(power)[: max(2, int(MAX_MEMORY_SHARE * count))]
    low = np.flatnonzero(correlation < FORGOTTEN * correlation[0])
    return 2 * int(low[0] if len(low) else len(correlation))
