"""What the rows say for and against each candidate: tests that respect correlation, gain on what was not fitted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.diagnosis.table import Table
from scara_ident.effects.spanned import ABSORBED

Array = NDArray[np.float64]

# A candidate of which less than this share lies outside the model cannot be told from it.
WEAK = 5e-4
# A fold that excites a candidate with less than this share of the mean over folds abstains.
ABSTAIN = 0.05


@dataclass(frozen=True, eq=False)
class Examination:
    """Statistics of one candidate, before any decision.

    Attributes
    ----------
    value : ndarray, shape (k,)
        Coefficients when it is added to the model.
    covariance : ndarray, shape (k, k)
        Of the coefficients, from block scores.
    p_value : float
        That all coefficients are zero; F test with block scores.
    outside : float
        Share of the candidate that the model does not span already.
    gain : float
        Fall of the weighted sum of squares on the rows it was fitted to, as a share.
    held_out : float
        The same with its coefficients fitted to the other folds; the model's own parameters are fitted to all, so
        that a fold which they cannot be fitted without does not speak against a candidate.
    fold_gains : tuple of float or None
        Per fold; None where the fold abstains.
    contribution : float
        Weighted sum of squares of what it adds.
    model_value : ndarray, shape (m,)
        The model's own parameters when the candidate is added.
    """

    value: Array
    covariance: Array
    p_value: float
    outside: float
    gain: float
    held_out: float
    fold_gains: tuple[float | None, ...]
    contribution: float
    model_value: Array

    @property
    def votes(self) -> tuple[int, int]:
        """Folds in which it helps, and folds that do not abstain."""
        voting = [gain for gain in self.fold_gains if gain is not None]
        return sum(gain > 0.0 for gain in voting), len(voting)


def examine(table: Table, model: Sequence[int], groups: Sequence[Sequence[int]]) -> list[Examination]:
    """Examine candidates beside a model.

    Parameters
    ----------
    table : Table
    model : sequence of int
        Columns that are in the model.
    groups : sequence of sequence of int
        Columns of each candidate.

    Returns
    -------
    list of Examination
    """
    columns = sorted({k for group in groups for k in group})
    place = {k: i for i, k in enumerate(columns)}
    wanted = [*columns, table.rows.shape[1] - 1]
    sums = _sums(table.whole, model, wanted)
    # Column by column in memory: every candidate takes a few columns of all rows.
    residual = np.asfortranarray(table.rows[:, wanted] - table.rows[:, model] @ sums)
    sizes = np.sum(table.rows[:, wanted] ** 2, axis=0)
    # What is left of a column that the model spans is rounding, and must not be scaled up.
    absorbed = np.sum(residual**2, axis=0) < ABSORBED * sizes
    folds = [factor[:, wanted] - factor[:, model] @ sums for factor in table.fold_factors]
    for part in (residual, *folds):
        part[:, absorbed] = 0.0
    return [_examine_one(table, residual, sizes, folds, sums, [place[k] for k in group]) for group in groups]


def _sums(factor: Array, model: Sequence[int], wanted: Sequence[int]) -> Array:
    """Return the sums of the model's columns that explain each wanted column best."""
    basis = factor[:, model]
    size = np.linalg.norm(basis, axis=0)
    size[size == 0.0] = 1.0
    return np.asarray(np.linalg.lstsq(basis / size, factor[:, wanted], rcond=1e-10)[0] / size[:, None])


def _examine_one(
    table: Table, residual: Array, sizes: Array, folds: Sequence[Array], sums: Array, group: list[int]
) -> Examination:
    columns, error = residual[:, group], residual[:, -1]
    left = np.sum(columns**2, axis=0)
    outside = float(np.max(left / np.maximum(sizes[group], np.finfo(float).tiny)))
    before = float(error @ error)
    k = len(group)
    if outside < ABSORBED or before == 0.0:
        nothing = np.zeros(k)
        return Examination(
            nothing, np.full((k, k), np.inf), 1.0, outside, 0.0, 0.0, (None,) * len(folds), 0.0, sums[:, -1]
        )
    products = [fold[:, group].T @ fold[:, group] for fold in folds]
    aims = [fold[:, group].T @ fold[:, -1] for fold in folds]
    value = _normal(np.sum(products, axis=0), np.sum(aims, axis=0))
    added = columns @ value
    after = error - added
    p_value, covariance = _block_test(table, columns, after, value, len(sums))
    mean = np.mean([np.trace(product) for product in products])
    gains: list[float | None] = []
    saved = 0.0
    for k_fold, (fold, product) in enumerate(zip(folds, products, strict=True)):
        base = float(fold[:, -1] @ fold[:, -1])
        if np.trace(product) < ABSTAIN * mean or base == 0.0:
            gains.append(None)
            continue
        guess = _normal(np.sum(products, axis=0) - product, np.sum(aims, axis=0) - aims[k_fold])
        with_it = fold[:, -1] - fold[:, group] @ guess
        saving = base - float(with_it @ with_it)
        gains.append(saving / base)
        saved += saving
    return Examination(
        value,
        covariance,
        p_value,
        outside,
        1.0 - float(after @ after) / before,
        saved / before,
        tuple(gains),
        float(added @ added),
        sums[:, -1] - sums[:, group] @ value,
    )


def _normal(product: Array, aim: Array) -> Array:
    """Solve normal equations of a few columns, scaled."""
    size = np.sqrt(np.diag(product))
    size[size == 0.0] = 1.0
    return np.asarray(np.linalg.pinv(product / np.outer(size, size), rcond=1e-9) @ (aim / size) / size)


def _block_test(table: Table, columns: Array, error: Array, value: Array, used: int) -> tuple[float, Array]:
    """F test that coefficients are zero, and their covariance, from scores of blocks with Bartlett's weights."""
    from scipy.special import fdtrc

    size = np.linalg.norm(columns, axis=0)
    size[size == 0.0] = 1.0
    unit = columns / size
    scores = np.add.reduceat(unit * error[:, None], table.starts, axis=0)
    meat = scores.T @ scores
    follows = table.recording[1:] == table.recording[:-1]
    cross = scores[1:][follows].T @ scores[:-1][follows]
    meat = meat + 0.5 * (cross + cross.T)
    blocks, k = len(table.starts), columns.shape[1]
    freedom = max(1.0, blocks - used / 2.0 - k)
    meat *= blocks / freedom
    inverse = np.linalg.pinv(unit.T @ unit, rcond=1e-9)
    covariance = inverse @ meat @ inverse
    scaled = value * size
    wald = float(scaled @ np.linalg.pinv(covariance, rcond=1e-9) @ scaled)
    # Blocks of one recording are few and alike, so the tail is F's rather than chi-squared's.
    p_value = float(fdtrc(k, freedom, max(wald, 0.0) / k))
    return p_value, covariance / np.outer(size, size)


def left_over(table: Table) -> Array:
    """Return the squared residual of every block when all columns are fitted, shape (blocks,)."""
    count = table.columns.shape[1]
    sums = _sums(table.whole, range(count), [count])[:, 0]
    return np.asarray(np.add.reduceat((table.torque - table.columns @ sums) ** 2, table.starts))
