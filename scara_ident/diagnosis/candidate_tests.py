"""What the rows say for and against each candidate: tests that respect correlation, gain on what was not fitted.

The model's columns are made orthonormal by the triangular factor of all rows, Z; a candidate's columns C leave
``X = C - Z (Z' C)`` and the torque leaves ``e``. Every statistic follows from the small products ``X' X`` and ``X' e`` of
each block of time, which need no row of X: ``X_b' X_b = C_b' C_b - C_b' Z_b S - S' Z_b' C_b + S' Z_b' Z_b S`` with
``S = Z' C``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scara_ident.diagnosis.candidates import Rows
from scara_ident.diagnosis.criteria import CRITERIA, SelectionCriteria
from scara_ident.estimation.information import orthonormal, weighted
from scara_ident.estimation.observations import JointRows
from scara_ident.threads import one_blas_thread

Array = NDArray[np.float64]

# Columns whose products are made together, and pairs of them: more of them take more memory than time.
_COLUMNS = 96
_PAIRS = 64


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
    left : ndarray, shape (blocks,)
        Weighted squared residual of every block with the candidate in the model.
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
    left: Array

    @property
    def votes(self) -> tuple[int, int]:
        """Folds in which it helps, and folds that do not abstain."""
        voting = [gain for gain in self.fold_gains if gain is not None]
        return sum(gain > 0.0 for gain in voting), len(voting)


@dataclass(frozen=True, eq=False)
class FittedModel:
    """A model fitted to the rows that candidates are tried beside.

    Attributes
    ----------
    joints : tuple of JointRows
        Rows of the model with the effects in it; blocks without any row are left out.
    parameters : int
        Columns of the model.
    owner, fold : ndarray of int, shape (blocks,)
        Recording and fold of each block.
    weights : ndarray, shape (n,)
        Weight of each joint's rows.
    """

    joints: tuple[JointRows, ...]
    parameters: int
    owner: NDArray[np.intp]
    fold: NDArray[np.intp]
    weights: Array

    @cached_property
    def root(self) -> Array:
        """Sums of columns that are orthonormal on all weighted rows, shape (m, r)."""
        whole = weighted([rows.information(self.parameters) for rows in self.joints], self.weights)
        return orthonormal(whole.regressor_factor)

    @cached_property
    def basis(self) -> tuple[Array, ...]:
        """The orthonormal columns on each joint's weighted rows, shape (r, N)."""
        return tuple(
            weight * (self.root[rows.columns].T @ rows.table[:-1])
            for rows, weight in zip(self.joints, self.weights, strict=True)
        )

    @cached_property
    def projected(self) -> Array:
        """The torque in the orthonormal columns, shape (r,)."""
        parts = zip(self.joints, self.basis, self.weights, strict=True)
        return np.asarray(np.sum([weight * (basis @ rows.table[-1]) for rows, basis, weight in parts], axis=0))

    @cached_property
    def residual(self) -> tuple[Array, ...]:
        """Weighted residual of each joint's rows, shape (N,)."""
        return tuple(
            weight * rows.table[-1] - self.projected @ basis
            for rows, basis, weight in zip(self.joints, self.basis, self.weights, strict=True)
        )

    @cached_property
    def squares(self) -> Array:
        """Weighted squared residual of every block, shape (blocks,)."""
        return self.by_block([error**2 for error in self.residual])

    @cached_property
    def basis_products(self) -> Array:
        """Products of the orthonormal columns in every block, shape (blocks, r, r)."""
        size = self.root.shape[1]
        total = np.zeros((len(self.owner), size, size))
        for rows, basis in zip(self.joints, self.basis, strict=True):
            for b, (start, stop) in enumerate(pairwise(rows.starts)):
                total[b] += basis[:, start:stop] @ basis[:, start:stop].T
        return total

    @cached_property
    def basis_scores(self) -> Array:
        """Products of the orthonormal columns with the residual in every block, shape (blocks, r)."""
        return np.asarray(
            self.by_block([basis * error for basis, error in zip(self.basis, self.residual, strict=True)]).T
        )

    @property
    def folds(self) -> int:
        """Number of folds."""
        return int(self.fold.max(initial=-1)) + 1

    def by_block(self, signals: Sequence[Array]) -> Array:
        """Sum signals of every joint's rows, shape (..., N), over blocks, shape (..., blocks)."""
        parts = zip(signals, self.joints, strict=True)
        return np.asarray(np.sum([_block_sums(signal, rows.starts) for signal, rows in parts], axis=0))


def _block_sums(signal: Array, starts: NDArray[np.intp]) -> Array:
    # A block may have no row of this joint, which `reduceat` would give its next one.
    padded = np.concatenate([signal, np.zeros((*signal.shape[:-1], 1))], axis=-1)
    sums = np.add.reduceat(padded, starts[:-1], axis=-1)
    sums[..., starts[:-1] == starts[1:]] = 0.0
    return np.asarray(sums)


@dataclass(frozen=True, eq=False)
class _Products:
    """Of one candidate with k columns, block by block.

    Attributes
    ----------
    sums : ndarray, shape (r, k)
        Its columns in the orthonormal ones of the model.
    sizes : ndarray, shape (k,)
        Weighted squares of its columns.
    columns : ndarray, shape (blocks, k, k)
        Products of what lies outside the model.
    scores : ndarray, shape (blocks, k)
        Products of that with the residual.
    """

    sums: Array
    sizes: Array
    columns: Array
    scores: Array


def examine(
    model: FittedModel, candidates: Sequence[Rows], criteria: SelectionCriteria = CRITERIA
) -> list[Examination]:
    """Examine candidates beside a model.

    Parameters
    ----------
    model : FittedModel
    candidates : sequence of mapping of int to ndarray, shape (k, N)
        Columns of each on the rows of every joint that it acts on.
    criteria : SelectionCriteria, optional

    Returns
    -------
    list of Examination
    """
    found: list[Examination] = []
    with one_blas_thread():
        for group in _groups(candidates):
            found += [_examination(model, products, criteria) for products in _products(model, group)]
    return found


def _groups(candidates: Sequence[Rows]) -> Iterator[list[Rows]]:
    """Give candidates in groups whose columns fit the memory of the products."""
    group: list[Rows] = []
    size = 0
    for rows in candidates:
        group.append(rows)
        size += len(next(iter(rows.values())))
        if size >= _COLUMNS:
            yield group
            group, size = [], 0
    if group:
        yield group


def _products(model: FittedModel, candidates: Sequence[Rows]) -> list[_Products]:
    widths = [len(next(iter(rows.values()))) for rows in candidates]
    begins = np.cumsum([0, *widths])
    size, blocks, r = int(begins[-1]), len(model.owner), model.root.shape[1]
    # Pairs of columns of one candidate.
    pairs = [
        (begin + a, begin + b) for begin, k in zip(begins, widths, strict=False) for a in range(k) for b in range(k)
    ]
    one, other = (
        (np.array(side, dtype=np.intp) for side in zip(*pairs, strict=True)) if pairs else (np.zeros(0, int),) * 2
    )
    sums, inner, outer = np.zeros((r, size)), np.zeros((len(pairs), blocks)), np.zeros((blocks, r, size))
    scores = np.zeros((size, blocks))
    for j, rows in enumerate(model.joints):
        own = [k for k, candidate in enumerate(candidates) if j in candidate]
        if not own:
            continue
        places = np.concatenate([np.arange(begins[k], begins[k + 1]) for k in own])
        columns = model.weights[j] * np.concatenate([candidates[k][j] for k in own])
        basis = model.basis[j]
        sums[:, places] += basis @ columns.T
        scores[places] += _block_sums(columns * model.residual[j], rows.starts)
        for b, (start, stop) in enumerate(pairwise(rows.starts)):
            outer[b][:, places] += basis[:, start:stop] @ columns[:, start:stop].T
        local = np.full(size, -1)
        local[places] = np.arange(len(places))
        held = np.flatnonzero(local[one] >= 0)
        for begin in range(0, len(held), _PAIRS):
            part = held[begin : begin + _PAIRS]
            inner[part] += _block_sums(columns[local[one[part]]] * columns[local[other[part]]], rows.starts)
    # S' (Z_b' Z_b S / 2 - Z_b' C_b) and its transpose are what the model takes from the products.
    change = 0.5 * (model.basis_products @ sums) - outer
    inner += np.array(
        [np.sum(sums[:, one] * part[:, other] + sums[:, other] * part[:, one], axis=0) for part in change]
    ).T
    scores -= (model.basis_scores @ sums).T
    sizes = np.sum(sums**2, axis=0)
    found, first = [], 0
    for begin, k in zip(begins, widths, strict=False):
        mine = slice(begin, begin + k)
        products = inner[first : first + k * k].T.reshape(blocks, k, k)
        first += k * k
        outside = np.diagonal(np.sum(products, axis=0))
        found.append(_Products(sums[:, mine], sizes[mine] + outside, products, scores[mine].T))
    return found


def _examination(model: FittedModel, found: _Products, criteria: SelectionCriteria) -> Examination:
    k, folds = len(found.sizes), model.folds
    left = np.diagonal(np.sum(found.columns, axis=0))
    # What is left of a column that the model spans is rounding, and must not be scaled up.
    absorbed = left < criteria.absorbed * found.sizes
    outside = float(np.max(np.where(absorbed, 0.0, left) / np.maximum(found.sizes, np.finfo(float).tiny), initial=0.0))
    before = float(np.sum(model.squares))
    if outside < criteria.absorbed or before == 0.0:
        nothing = np.zeros(k)
        own = model.root @ model.projected
        return Examination(
            nothing, np.full((k, k), np.inf), 1.0, outside, 0.0, 0.0, (None,) * folds, 0.0, own, model.squares
        )
    products = np.where(absorbed[:, None] | absorbed, 0.0, found.columns)
    scores = np.where(absorbed, 0.0, found.scores)
    whole, aim = np.sum(products, axis=0), np.sum(scores, axis=0)
    value = _normal(whole, aim)
    added = float(value @ whole @ value)
    after = model.squares - 2.0 * scores @ value + np.einsum("i,bij,j->b", value, products, value)
    p_value, covariance = _block_test(model, whole, scores - products @ value, value)
    fold_products, aims = (
        np.array([np.sum(part[model.fold == f], axis=0) for f in range(folds)]) for part in (products, scores)
    )
    mean = float(np.mean(np.trace(fold_products, axis1=1, axis2=2)))
    gains: list[float | None] = []
    saved = 0.0
    for f in range(folds):
        base = float(np.sum(model.squares[model.fold == f]))
        if np.trace(fold_products[f]) < criteria.abstains * mean or base == 0.0:
            gains.append(None)
            continue
        guess = _normal(whole - fold_products[f], aim - aims[f])
        saving = float(2.0 * guess @ aims[f] - guess @ fold_products[f] @ guess)
        gains.append(saving / base)
        saved += saving
    return Examination(
        value,
        covariance,
        p_value,
        outside,
        (before - float(np.sum(after))) / before,
        saved / before,
        tuple(gains),
        added,
        model.root @ (model.projected - found.sums @ value),
        after,
    )


def _normal(product: Array, aim: Array) -> Array:
    """Solve normal equations of a few columns, scaled."""
    size = np.sqrt(np.diag(product))
    size[size == 0.0] = 1.0
    return np.asarray(np.linalg.pinv(product / np.outer(size, size), rcond=1e-9) @ (aim / size) / size)


def _block_test(model: FittedModel, product: Array, scores: Array, value: Array) -> tuple[float, Array]:
    """F test that coefficients are zero, and their covariance, from scores of blocks with Bartlett's weights."""
    from scipy.special import fdtrc

    size = np.sqrt(np.diag(product))
    size[size == 0.0] = 1.0
    unit = scores / size
    follows = model.owner[1:] == model.owner[:-1]
    cross = unit[1:][follows].T @ unit[:-1][follows]
    meat = unit.T @ unit + 0.5 * (cross + cross.T)
    blocks, k = len(model.owner), len(value)
    freedom = max(1.0, blocks - model.parameters / 2.0 - k)
    meat *= blocks / freedom
    inverse = np.linalg.pinv(product / np.outer(size, size), rcond=1e-9)
    covariance = inverse @ meat @ inverse
    scaled = value * size
    wald = float(scaled @ np.linalg.pinv(covariance, rcond=1e-9) @ scaled)
    # Blocks of one recording are few and alike, so the tail is F's rather than chi-squared's.
    p_value = float(fdtrc(k, freedom, max(wald, 0.0) / k))
    return p_value, covariance / np.outer(size, size)
