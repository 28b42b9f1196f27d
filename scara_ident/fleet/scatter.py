"""Scatter from date to date in a fleet without change: of runs, and of each cause beyond its noise."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import NORMAL_MEDIAN, Array
from scara_ident.fleet.history import (
    TRIM_STDS,
    TRIMMED_VARIANCE,
    History,
    common_removed,
    pseudo_inverses,
    variance_prior,
)
from scara_ident.fleet.runs import run_scatter

# Causes of which runs are less than this share of the variance tell each other how much larger than noise it is.
BY_RUNS = 0.5
# A combination of which less is left beside the common parameters, as a share of its square, is one of them.
LEFT_SHARE = 1e-9


@dataclass(frozen=True, eq=False)
class Scatter:
    """What differs from date to date in a fleet, where nothing changes.

    Attributes
    ----------
    runs : ndarray, shape (5 n, 11 n)
        A root of the covariance of runs, see `run_scatter`.
    causes : mapping of str to ndarray, shape (s,)
        By a cause's label how much larger than their noise differences of each of its sizes are, as a ratio of squares, at
        least 1: a tilt about one axis may differ from date to date and that about the other not.
    freedom : float
        Degrees of freedom of ``runs``.
    freedoms : mapping of str to float
        By a cause's label of both together.
    """

    runs: Array
    causes: Mapping[str, Array]
    freedom: float
    freedoms: Mapping[str, float]


def fleet_scatter(histories: Sequence[History]) -> Scatter:
    """Return what differs from date to date in a fleet.

    A cause's variance is that of runs and of noise. The first is as sure as `run_scatter` tells it; how much larger the second
    is than noise all causes tell each other, see `variance_prior`, and with no more degrees of freedom than all of them have
    together (Smyth 2004). The degrees of freedom of the sum are Satterthwaite's (1946).

    Parameters
    ----------
    histories : sequence of History
        Of one robot and model.
    """
    runs, freedom_of_runs = run_scatter(histories)
    freedom = max(1.0, freedom_of_runs)
    found: dict[str, list[Array]] = {}
    parts: dict[str, list[float]] = {}
    for history in histories:
        if len(history.dates) < 2:
            continue
        rows = history.whitened(runs)
        left, _ = common_removed(rows)
        for k, cause in enumerate(history.causes):
            aims = np.array([row.directions[k].T @ rest for row, rest in zip(rows, left, strict=True)])
            spread, alone = (
                inverses_by_size(np.array([row.directions[k].T @ row.directions[k] for row in each]))
                for each in (rows, history.rows)
            )
            sizes = np.einsum("dij,dj->di", spread, aims)
            step, noise = np.diff(sizes, axis=0), np.einsum("dii->di", spread[1:] + spread[:-1])
            # What all dates share is the same on both dates of a difference, and takes nothing of it.
            squares = np.where(noise > 0.0, step**2 / np.where(noise > 0.0, noise, 1.0), 0.0)
            found.setdefault(cause.label, []).append(squares)
            own, whole = np.einsum("dii->i", alone), np.einsum("dii->i", spread)
            parts.setdefault(cause.label, []).append(1.0 - float(np.min(own / np.where(whole > 0.0, whole, np.inf))))
    # As `scatter` does: in noise the median alone is worth a third as many differences.
    raw = {label: _mean_square(np.concatenate(squares)) for label, squares in found.items()}
    by_runs = {label: float(np.mean(part)) for label, part in parts.items()}
    noisy = [ratio for label, ratio in raw.items() if by_runs[label] < BY_RUNS]
    pooled = np.concatenate(noisy) if noisy else np.zeros(0)
    prior, usual = variance_prior(pooled, freedom)
    moderated = min(freedom + prior, freedom * max(1, int(np.count_nonzero(pooled > 0.0))))
    weight = freedom / (freedom + prior)
    ratios = {label: np.maximum(1.0, usual + weight * (ratio - usual)) for label, ratio in raw.items()}
    freedoms = {label: 1.0 / (part**2 / freedom + (1.0 - part) ** 2 / moderated) for label, part in by_runs.items()}
    return Scatter(runs, ratios, freedom, freedoms)


def _mean_square(squares: Array) -> Array:
    usual = np.median(squares, axis=0) / NORMAL_MEDIAN**2
    return np.asarray(np.nanmean(np.where(squares <= TRIM_STDS**2 * usual, squares, np.nan), axis=0) / TRIMMED_VARIANCE)


def inverses_by_size(matrices: Array) -> Array:
    """Return the pseudo-inverses of symmetric matrices, shape (N, k, k), each in units of its own diagonal."""
    size = np.sqrt(np.maximum(np.einsum("nii->ni", matrices), np.finfo(float).tiny))
    scale = size[:, :, None] * size[:, None, :]
    if matrices.shape[1] == 1:
        return np.where(matrices > np.finfo(float).tiny, 1.0 / scale, 0.0)
    return np.asarray(pseudo_inverses(matrices / scale, LEFT_SHARE) / scale)
