"""A model fitted to rows, and the products of candidate columns beside it, block of time by block of time.

The model's columns are made orthonormal by the triangular factor of all rows, Z; a candidate's columns C leave
``X = C - Z S`` with ``S = Z' C``, and the torque leaves ``e``. Every statistic follows from the small products ``X' X`` and
``X' e`` of each block, which need no row of X: ``X_b' X_b = C_b' C_b - C_b' Z_b S - S' Z_b' C_b + S' Z_b' Z_b S``.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.diagnosis.candidates.candidates import Rows
from scara_ident.estimation.information import orthonormal, weighted
from scara_ident.estimation.joint_rows import JointRows
from scara_ident.threads import THREADS, side_by_side

# What a block leaves to the others of a direction is at least this share: less is rounding.
MIN_REDUNDANCY = 1e-9
# A block whose products have a smaller norm leaves a tenth of every direction to the others.
WELL_SHARED = 0.9
# Up to so many signals for each direction they are solved for in less time than the inverse is made.
FEW_SIGNALS = 0.5


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
        whole = weighted(side_by_side(lambda rows: rows.information(self.parameters), self.joints), self.weights)
        return orthonormal(whole.regressor_factor)

    def basis(self, joint: int) -> Array:
        """Return the orthonormal columns on a joint's weighted rows, shape (r, N); not kept, as they are as large as the rows."""
        rows = self.joints[joint]
        return np.asarray((self.weights[joint] * self.root[rows.columns]).T @ rows.table[:-1])

    def sums(self, joint: int, signals: Array) -> Array:
        """Return the products of signals on a joint's weighted rows, shape (k, N), with the orthonormal columns, shape (k, r)."""
        rows = self.joints[joint]
        return np.asarray(signals @ rows.table[:-1].T @ (self.weights[joint] * self.root[rows.columns]))

    @cached_property
    def projected(self) -> Array:
        """The torque in the orthonormal columns, shape (r,)."""
        parts = enumerate(zip(self.joints, self.weights, strict=True))
        return np.asarray(np.sum([weight * self.sums(j, rows.table[-1:])[0] for j, (rows, weight) in parts], axis=0))

    @cached_property
    def residual(self) -> tuple[Array, ...]:
        """Weighted residual of each joint's rows, shape (N,)."""
        value = self.root @ self.projected
        return tuple(weight * rows.left(value) for rows, weight in zip(self.joints, self.weights, strict=True))

    @cached_property
    def in_blocks(self) -> tuple[NDArray[np.intp], ...]:
        """Rows of each joint by block, shape (blocks, m); where a block has fewer, the number of all rows."""
        found = []
        for rows in self.joints:
            sizes = np.diff(rows.starts)
            place = np.arange(int(sizes.max(initial=1)))
            found.append(np.where(place < sizes[:, None], rows.starts[:-1, None] + place, rows.table.shape[1]))
        return tuple(found)

    @cached_property
    def _stops(self) -> NDArray[np.intp]:
        """Where the rows of each joint end in a block that has those of all, shape (n + 1,), the first of them 0."""
        return np.cumsum([0, *(places.shape[1] for places in self.in_blocks)])

    @cached_property
    def _together(self) -> tuple[Array, Array]:
        """The orthonormal columns (blocks, m, r) and the residual (blocks, m) of all joints by block, zero where there is no row."""
        blocks, size = len(self.owner), self.root.shape[1]
        columns, errors = np.empty((blocks, self._stops[-1], size)), np.empty((blocks, self._stops[-1]))
        for j, places in enumerate(self.in_blocks):
            own = slice(*self._stops[j : j + 2])
            # Row by row, so that whole rows are copied.
            columns[:, own] = np.concatenate([self.basis(j).T, np.zeros((1, size))])[places]
            errors[:, own] = _by_block(self.residual[j], places)
        return columns, errors

    def rows_of(self, joints: tuple[int, ...]) -> tuple[Array, Array]:
        """Return the orthonormal columns (blocks, m, r) and the residual (blocks, m) of joints by block; of neighbours, a view."""
        columns, errors = self._together
        places = np.concatenate([np.arange(*self._stops[j : j + 2]) for j in joints])
        # Most effects act on neighbours, and a copy for each of their sets would be most of what a search needs.
        some = slice(places[0], places[-1] + 1) if np.all(np.diff(places) == 1) else places
        return columns[:, some], errors[:, some]

    @cached_property
    def squares(self) -> Array:
        """Weighted squared residual of every block, shape (blocks,)."""
        parts = zip(self.residual, self.in_blocks, strict=True)
        return np.asarray(np.sum([np.sum(_by_block(error, places) ** 2, axis=-1) for error, places in parts], axis=0))

    @cached_property
    def basis_products(self) -> Array:
        """Products of the orthonormal columns in every block, shape (blocks, r, r)."""
        together, _ = self._together
        found = np.empty((len(together), together.shape[2], together.shape[2]))
        # One after the other NumPy sees that a product with itself is symmetric.
        for rows, product in zip(together, found, strict=True):
            np.matmul(rows.T, rows, out=product)
        return found

    @cached_property
    def released(self) -> Array:
        """Inverse of what each block leaves to the others of the orthonormal columns, shape (blocks, r, r)."""
        return self._released(np.broadcast_to(np.eye(self.basis_products.shape[-1]), self.basis_products.shape))

    def ready_for(self, count: int) -> None:
        """Make what so many signals in all will need, once, and not in two threads."""
        if count >= FEW_SIGNALS * self.root.shape[1]:
            _ = self.released

    def reaching(self, signals: Array) -> Array:
        """Return signals of blocks, shape (g, blocks, k, r), times `released`, which is not made for a few of them."""
        g, blocks, k, r = signals.shape
        rows = signals.transpose(1, 0, 2, 3).reshape(blocks, g * k, r)
        few = g * k < FEW_SIGNALS * r and "released" not in self.__dict__
        found = self._released(rows.transpose(0, 2, 1)).transpose(0, 2, 1) if few else rows @ self.released
        return np.asarray(found.reshape(blocks, g, k, r).transpose(1, 0, 2, 3))

    def _released(self, columns: Array) -> Array:
        """Return `released` times columns, shape (blocks, r, m)."""
        result = np.empty(columns.shape)

        def solve(some: slice) -> None:
            products, own = self.basis_products[some], columns[some]
            left = np.eye(products.shape[-1]) - products
            # Where something is left of every direction the plain solution is as good, in a fifth of the time.
            strong = np.linalg.norm(products, axis=(1, 2)) < WELL_SHARED
            result[some][strong] = np.linalg.solve(left[strong], own[strong])
            held, directions = np.linalg.eigh(left[~strong])
            turned = directions.transpose(0, 2, 1) @ own[~strong]
            result[some][~strong] = directions @ (turned / np.maximum(held, MIN_REDUNDANCY)[:, :, None])

        side_by_side(solve, [slice(k, None, THREADS) for k in range(THREADS)])
        return result

    @cached_property
    def basis_scores(self) -> Array:
        """Products of the orthonormal columns with the residual in every block, shape (blocks, r)."""
        return np.asarray(np.einsum("bmr,bm->br", *self._together))

    def with_folds(self, fold: NDArray[np.intp]) -> FittedModel:
        """Return the same model with other folds, and with all that was made of it: nothing that is kept depends on them."""
        other = replace(self, fold=fold)
        other.__dict__.update({name: made for name, made in self.__dict__.items() if name not in other.__dict__})
        return other

    @property
    def folds(self) -> int:
        """Number of folds."""
        return int(self.fold.max(initial=-1)) + 1


def _by_block(signals: Array, places: NDArray[np.intp]) -> Array:
    """Return signals, shape (..., N), by block: (blocks, ..., m), zero where a block has no row."""
    padded = np.concatenate([signals, np.zeros((*signals.shape[:-1], 1))], axis=-1)
    found = padded[..., places]
    return found if signals.ndim == 1 else np.moveaxis(found, -2, 0)


@dataclass(frozen=True, eq=False)
class Products:
    """Of g candidates with k columns each, block by block.

    Attributes
    ----------
    sums : ndarray, shape (g, k, r)
        Their columns in the orthonormal ones of the model.
    sizes : ndarray, shape (g, k)
        Weighted squares of their columns.
    columns : ndarray, shape (g, blocks, k, k)
        Products of what lies outside the model.
    scores : ndarray, shape (g, blocks, k)
        Products of that with the residual.
    cross : ndarray, shape (g, blocks, k, r)
        Products of that with the orthonormal columns of the model.
    """

    sums: Array
    sizes: Array
    columns: Array
    scores: Array
    cross: Array


def products_of(model: FittedModel, candidates: Sequence[Rows]) -> Products:
    """Return the products of candidates, which have as many columns each, beside a model.

    Parameters
    ----------
    candidates : sequence of mapping of int to ndarray, shape (k, N)
        Columns of each on the rows of every joint that it acts on.
    """
    g, k = len(candidates), len(next(iter(candidates[0].values())))
    blocks, r = len(model.owner), model.root.shape[1]
    inner, outer = np.empty((blocks, g, k, k)), np.empty((blocks, g, k, r))
    scores = np.empty((blocks, g, k))
    alike: dict[tuple[int, ...], list[int]] = {}
    for place, candidate in enumerate(candidates):
        alike.setdefault(tuple(sorted(candidate)), []).append(place)
    for joints, places in alike.items():
        # Into what follows each other nothing is copied twice.
        own = slice(places[0], places[-1] + 1) if places[-1] - places[0] < len(places) else places
        columns = [model.weights[j] * np.concatenate([candidates[i][j] for i in places]) for j in joints]
        in_blocks = [_by_block(part, model.in_blocks[j]) for j, part in zip(joints, columns, strict=True)]
        rows = np.concatenate(in_blocks, axis=2)
        basis, error = model.rows_of(joints)
        each = rows.reshape(blocks, len(places), k, -1)
        inner[:, own] = each @ each.transpose(0, 1, 3, 2)
        outer[:, own] = (rows @ basis).reshape(blocks, len(places), k, r)
        scores[:, own] = (rows @ error[:, :, None]).reshape(blocks, len(places), k)
    sums = np.sum(outer, axis=0)
    # S' (Z_b' Z_b S / 2 - Z_b' C_b) and its transpose are what the model takes from the products.
    spanned = (sums.reshape(g * k, r) @ model.basis_products).reshape(blocks, g, k, r)
    half = 0.5 * spanned - outer
    change = half @ sums.transpose(0, 2, 1)
    inner += change + change.transpose(0, 1, 3, 2)
    scores -= (model.basis_scores @ sums.reshape(g * k, r).T).reshape(blocks, g, k)
    outside = np.diagonal(np.sum(inner, axis=0), axis1=1, axis2=2)
    sizes = np.sum(sums**2, axis=2) + outside
    outer -= spanned
    return Products(sums, sizes, inner.transpose(1, 0, 2, 3), scores.transpose(1, 0, 2), outer.transpose(1, 0, 2, 3))
