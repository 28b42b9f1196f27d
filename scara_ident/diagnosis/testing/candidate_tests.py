"""Tests of each candidate: significance under correlated residuals, and gain in cross-validation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import chain
from typing import TypeVar

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Rows
from scara_ident.diagnosis.criteria import CRITERIA, SelectionCriteria
from scara_ident.diagnosis.testing.cluster_test import cluster_test
from scara_ident.diagnosis.testing.fitted_model import FittedModel, Products, products_of
from scara_ident.threads import side_by_side

T = TypeVar("T")
# Number of columns whose products are computed together: more would take more memory without saving time.
_COLUMNS = 32
# Directions of a few columns below this share of the largest are not solved for.
_RANK = 1e-9


@dataclass(frozen=True, eq=False)
class Examination:
    """Statistics of one candidate, before any decision.

    Attributes
    ----------
    value : ndarray, shape (k,)
        Coefficients when it is added to the model.
    tested : ndarray, shape (k,)
        The same, with blocks weighted where few of them hold most of its columns, see `ClusterTest.value`.
    covariance : ndarray, shape (k, k)
        Of the coefficients tested, from block scores.
    p_value : float
        That all coefficients are zero, see `cluster_test`.
    outside : float
        Share of the candidate that the model does not span already.
    gain : float
        Relative reduction of the weighted sum of squares on the fitted rows.
    held_out : float
        The same in cross-validation: its coefficients are fitted to the other folds. The model's own parameters are
        fitted to all folds, so a fold that they need does not count against a candidate.
    fold_gains : tuple of float or None
        Per fold; None where the fold abstains.
    model_value : ndarray, shape (m,)
        The model's own parameters when the candidate is added.
    left : ndarray, shape (blocks,)
        Weighted squared residual of every block with the candidate in the model.
    products : ndarray, shape (k, k)
        Weighted products of the part of its columns outside the model.
    freedom : float
        Degrees of freedom of the covariance.
    """

    value: Array
    tested: Array
    covariance: Array
    p_value: float
    outside: float
    gain: float
    held_out: float
    fold_gains: tuple[float | None, ...]
    model_value: Array
    left: Array
    products: Array
    freedom: float

    @property
    def votes(self) -> tuple[int, int]:
        """Folds in which it helps, and folds that do not abstain."""
        voting = [gain for gain in self.fold_gains if gain is not None]
        return sum(gain > 0.0 for gain in voting), len(voting)


def examine(
    model: FittedModel, candidates: Sequence[Rows], criteria: SelectionCriteria = CRITERIA
) -> list[Examination]:
    """Test candidates with a model.

    Parameters
    ----------
    candidates : sequence of mapping of int to ndarray, shape (k, N)
        Columns of each on the rows of every joint that it acts on.
    """
    model.ready_for(sum(len(next(iter(rows.values()))) for rows in candidates))
    return _in_groups(model, candidates, lambda group: _examinations(model, products_of(model, group), criteria))


def coefficients(model: FittedModel, candidate: Rows, criteria: SelectionCriteria = CRITERIA) -> tuple[Array, Array]:
    """Return `Examination.value` and `Examination.products` of a candidate, without the work of a test."""
    columns = {joint: model.weights[joint] * rows for joint, rows in candidate.items()}
    sums = np.sum([model.sums(joint, rows) for joint, rows in columns.items()], axis=0)
    squares = sum(rows @ rows.T for rows in columns.values())
    aim = sum(rows @ model.residual[joint] for joint, rows in columns.items())
    products = squares - sums @ sums.T
    absorbed = np.diag(products) < criteria.absorbed * np.diag(squares)
    products = np.where(absorbed[:, None] | absorbed, 0.0, products)
    return _normal(products, np.where(absorbed, 0.0, aim)), products


def held_out_gains(
    model: FittedModel, candidates: Sequence[Rows], criteria: SelectionCriteria = CRITERIA
) -> list[float]:
    """Return `Examination.held_out` of candidates alone, in less than half the time."""
    before = float(np.sum(model.squares))

    def of_group(group: Sequence[Rows]) -> list[float]:
        outside, products, scores = _outside(products_of(model, group), criteria)
        _, saved, voting = _in_folds(model, products, scores, criteria)
        seen = (outside >= criteria.absorbed) & (before > 0.0)
        return [
            float(gain) for gain in np.where(seen, np.sum(np.where(voting, saved, 0.0), axis=0) / (before or 1.0), 0.0)
        ]

    return _in_groups(model, candidates, of_group)


def gains(
    model: FittedModel, candidates: Sequence[Rows], joints: Sequence[int | None], found: Sequence[Examination]
) -> list[float]:
    """Return the gain of each candidate in cross-validation: what it removes, as a share of that and the rest on its joint.

    For a small gain it is about the share of its joint's squared residual. It is never above 1, although a candidate
    may remove more on other joints, through its columns there and through the model's parameters, than its joint has.

    Parameters
    ----------
    candidates : sequence of mapping of int to ndarray, shape (k, N)
    joints : sequence of int or None
        The joint of each; None counts all joints.
    found : sequence of Examination
        Of each candidate.
    """
    result = np.array([item.held_out for item in found])
    total = float(np.sum(model.squares))
    for joint in {joint for joint in joints if joint is not None}:
        own = [k for k, place in enumerate(joints) if place == joint]
        whole = total * np.array([found[k].gain for k in own])
        removed = total * result[own]
        # The cost of holding out counts as residual.
        left = _left(model, joint, [candidates[k] for k in own], [found[k] for k in own]) + whole - removed
        result[own] = removed / np.maximum(np.maximum(removed, 0.0) + left, np.finfo(float).tiny)
    return [float(gain) for gain in result]


def _left(model: FittedModel, joint: int, candidates: Sequence[Rows], found: Sequence[Examination]) -> Array:
    """Return the weighted squared residual of one joint with each candidate, on the rows they were fitted to."""
    rows = model.joints[joint]
    values = np.array([item.model_value[rows.columns] for item in found])
    left = rows.table[-1] - values @ rows.table[:-1]
    for error, columns, item in zip(left, candidates, found, strict=True):
        if joint in columns:
            error -= item.value @ columns[joint]
    return np.asarray(model.weights[joint] ** 2 * np.sum(left**2, axis=1))


def _in_groups(
    model: FittedModel, candidates: Sequence[Rows], function: Callable[[Sequence[Rows]], Sequence[T]]
) -> list[T]:
    """Apply a function to candidates of as many columns each, and return the results in the order of the candidates."""
    widths = [len(next(iter(rows.values()))) for rows in candidates]
    groups: list[list[int]] = []
    for k in dict.fromkeys(widths):
        same = [place for place, width in enumerate(widths) if width == k]
        # Those of the same joints follow each other.
        same.sort(key=lambda place: tuple(sorted(candidates[place])))
        size = max(1, _COLUMNS // k)
        groups += [same[start : start + size] for start in range(0, len(same), size)]
    if len(groups) > 1:
        _ = model.residual, model.basis_products, model.basis_scores
    results = side_by_side(lambda group: function([candidates[place] for place in group]), groups)
    found = dict(zip(chain.from_iterable(groups), chain.from_iterable(results), strict=True))
    return [found[place] for place in range(len(candidates))]


def _outside(found: Products, criteria: SelectionCriteria) -> tuple[Array, Array, Array]:
    """Return the share of each candidate outside the model, and the products and scores of what is no rounding."""
    left = np.diagonal(np.sum(found.columns, axis=1), axis1=1, axis2=2)
    # The rest of a column within the span of the model is rounding, and must not be scaled up.
    absorbed = left < criteria.absorbed * found.sizes
    outside = np.max(np.where(absorbed, 0.0, left) / np.maximum(found.sizes, np.finfo(float).tiny), axis=1)
    products = np.where((absorbed[:, :, None] | absorbed[:, None, :])[:, None], 0.0, found.columns)
    return outside, products, np.where(absorbed[:, None], 0.0, found.scores)


def _in_folds(
    model: FittedModel, products: Array, scores: Array, criteria: SelectionCriteria
) -> tuple[Array, Array, Array]:
    """Return the residual's squares (f,) of each fold, what coefficients of the others save of them, and who votes, (f, g)."""
    in_fold = [model.fold == f for f in range(model.folds)]
    base = np.array([np.sum(model.squares[mask]) for mask in in_fold])
    fold_products = np.array([np.sum(products[:, mask], axis=1) for mask in in_fold])
    aims = np.array([np.sum(scores[:, mask], axis=1) for mask in in_fold])
    excited = np.trace(fold_products, axis1=2, axis2=3)
    voting = (excited >= criteria.abstains * np.mean(excited, axis=0)) & (base[:, None] > 0.0)
    guess = _normal(np.sum(products, axis=1) - fold_products, np.sum(scores, axis=1) - aims)
    saved = np.einsum("fgi,fgi->fg", guess, 2.0 * aims - np.einsum("fgij,fgj->fgi", fold_products, guess))
    return base, saved, voting


def _examinations(model: FittedModel, found: Products, criteria: SelectionCriteria) -> list[Examination]:
    """Examine candidates that have as many columns each."""
    k, folds, squares = found.sizes.shape[1], model.folds, model.squares
    outside, products, scores = _outside(found, criteria)
    whole, aim = np.sum(products, axis=1), np.sum(scores, axis=1)
    value = _normal(whole, aim)
    predicted = np.einsum("gbij,gj->gbi", products, value)
    after = squares - np.einsum("gbi,gi->gb", 2.0 * scores - predicted, value)
    test = cluster_test(model, found, whole, value, scores - predicted, products)
    base, saved, voting = _in_folds(model, products, scores, criteria)
    shares = saved / np.where(base > 0.0, base, 1.0)[:, None]
    before = float(np.sum(squares))
    own = model.root @ (model.projected[:, None] - np.einsum("gkr,gk->rg", found.sums, value))
    results = []
    for g in range(len(value)):
        if outside[g] < criteria.absorbed or before == 0.0:
            nothing, unknown = np.zeros(k), np.full((k, k), np.inf)
            alone = model.root @ model.projected
            results.append(
                Examination(
                    nothing,
                    nothing,
                    unknown,
                    1.0,
                    float(outside[g]),
                    0.0,
                    0.0,
                    (None,) * folds,
                    alone,
                    squares,
                    whole[g],
                    1.0,
                )
            )
            continue
        results.append(
            Examination(
                value[g],
                test.value[g],
                test.covariance[g],
                float(test.p_value[g]),
                float(outside[g]),
                (before - float(np.sum(after[g]))) / before,
                float(np.sum(saved[voting[:, g], g])) / before,
                tuple(float(gain) if votes else None for gain, votes in zip(shares[:, g], voting[:, g], strict=True)),
                own[:, g],
                after[g],
                whole[g],
                float(test.freedom[g]),
            )
        )
    return results


def _scaled(product: Array) -> tuple[Array, Array]:
    """Return the sizes of columns, shape (..., k), and their products when they have unit size."""
    size = np.sqrt(np.diagonal(product, axis1=-2, axis2=-1))
    size = np.where(size == 0.0, 1.0, size)
    return size, product / (size[..., :, None] * size[..., None, :])


def _normal(product: Array, aim: Array) -> Array:
    """Solve normal equations of a few columns, scaled: (..., k, k) and (..., k)."""
    # For a column that only one fold excites, the rest in other folds may be negative by rounding.
    product = np.where(np.eye(product.shape[-1], dtype=bool), np.maximum(product, 0.0), product)
    size, unit = _scaled(product)
    return np.asarray(np.einsum("...ij,...j->...i", np.linalg.pinv(unit, rcond=_RANK), aim / size) / size)
