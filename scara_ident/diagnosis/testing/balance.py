"""Block weights that keep a test's degrees of freedom where one block holds most of the information on a candidate.

A coefficient that one block tells has about one degree of freedom, and takes thousands of standard errors to be
significant, however clearly all other blocks tell it as well. With weights the block counts for less: a coefficient that
differs from block to block with the variance ``1 / c``, in units of its own, is best known with block b at the weight
``w_b = 1 / (1 + h_b / c)``, where ``h_b`` is the block's share of the square of what the weighted model leaves of the columns
(Swamy, Econometrica 38(2), 1970). No coefficient needs to differ: weighted least squares are unbiased at any weights, and
c is the one at which the coefficients have to be least large to be significant. Leaving the block out altogether takes up
to twice as much. All of it follows from the columns: no torque takes part, so that the test keeps its level with nothing
to pay for the choice.

With X the columns outside the model, Z the model's and T their weighted regression, ``V = w (X - Z T')`` are instruments for
X: ``(V' X)^-1 V' u`` are the coefficients.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.testing.fitted_model import FittedModel, Products

# Variances c^-1 that are tried: from a block of a third of the columns' square at half its weight to one of 0.3 %.
BENDS = (0.3, 0.1, 0.03, 0.01, 0.003)


@dataclass(frozen=True, eq=False)
class Weighted:
    """Coefficients by weighted blocks, and how they follow from single blocks.

    With D the matrix that takes a block's residual to what leaving it out changes, Z the model's and V the weighted columns.

    Attributes
    ----------
    spread : ndarray, shape (g, k, k)
        Covariance of the coefficients where residuals are white of variance one.
    spanned : ndarray, shape (g, k, r)
        What the weighted model spans of X, which V is without.
    strength : ndarray, shape (g,)
        Least share of a direction that the other blocks hold.
    release : ndarray, shape (g, blocks, k, k)
        From a block's scores to what leaving it out changes.
    reach : ndarray, shape (g, blocks, k, r)
        What the model's scores in a block add to those of the coefficients once it is left out.
    own : ndarray, shape (g, blocks, k, k)
        Products of V with X.
    alone, links, signs : ndarray, shape (g, blocks, k, k), (g, blocks, k, m), (m,)
        D's square and its products with the columns that residuals are without (-1) or have more of (+1).
    """

    spread: Array
    spanned: Array
    strength: Array
    release: Array
    reach: Array
    own: Array
    alone: Array
    links: Array
    signs: Array


def weighted(model: FittedModel, found: Products, weights: Array) -> Weighted:
    """Return what a test needs of weighted blocks.

    Parameters
    ----------
    found : Products
        Of candidates, in units in which the products of all blocks are the identity.
    weights : ndarray, shape (g, blocks)
    """
    each = weights[..., None, None]
    columns, cross, basis = found.columns, found.cross, model.basis_products
    spanned = _spanned(model, found, weights)
    across = each * (cross - spanned @ basis)
    own = each * (columns - spanned @ _t(cross))
    bent = each * (own - across @ _t(spanned))
    whole = np.sum(own, axis=1)
    # Directions that no column has stay as they are.
    size = np.diagonal(whole, axis1=1, axis2=2)
    whole = whole + np.eye(whole.shape[-1]) * (size == 0.0)[:, None]
    reach = model.reaching(across)
    left = whole[:, None] - own - reach @ _t(cross)
    root = power(whole, -0.5)[:, None]
    strength = np.min(np.linalg.eigvalsh(0.5 * root @ (left + _t(left)) @ root), axis=(1, 2))
    good = strength[:, None, None, None] > 0.0
    release = np.linalg.inv(np.where(good, left, np.eye(left.shape[-1])))
    seen = across + reach @ basis
    alone = bent + across @ _t(reach) + reach @ _t(seen)
    square, inverse = np.sum(bent, axis=1), np.linalg.pinv(whole, hermitian=True)
    first = (bent + reach @ _t(across)) @ power(square, -0.5)[:, None]
    second = (own + reach @ _t(cross)) @ (inverse @ power(square, 0.5))[:, None] - first
    links = release @ np.concatenate([seen, first, second], axis=-1)
    k, r = cross.shape[-2:]
    signs = np.repeat([-1.0, 1.0], [r + k, k])
    return Weighted(
        inverse @ square @ inverse,
        spanned[:, 0],
        strength,
        release,
        reach,
        own,
        release @ alone @ _t(release),
        links,
        signs,
    )


def _spanned(model: FittedModel, found: Products, weights: Array) -> Array:
    """Return what the weighted model spans of X, shape (g, 1, k, r)."""
    each = weights[..., None, None]
    held = np.einsum("gb,brs->grs", weights, model.basis_products)
    return np.asarray(np.sum(each * found.cross, axis=1) @ np.linalg.pinv(held, hermitian=True))[:, None]


def shares_of(model: FittedModel, found: Products, weights: Array) -> Array:
    """Return the share of each block of the square of what the weighted model leaves of the columns, shape (g, blocks)."""
    spanned = _spanned(model, found, weights)
    left = found.columns - found.cross @ _t(spanned) - spanned @ _t(found.cross - spanned @ model.basis_products)
    whole = power(np.sum(left, axis=1), -0.5)[:, None]
    # Of columns that the model nearly holds rounding leaves less than nothing in some blocks: those have no share.
    return np.asarray(np.maximum(np.max(np.linalg.eigvalsh(whole @ left @ whole), axis=2), 0.0))


def _t(matrices: Array) -> Array:
    return np.asarray(np.swapaxes(matrices, -1, -2))


def power(matrices: Array, power: float) -> Array:
    """Return powers of symmetric matrices, zero in directions that they do not have."""
    if matrices.shape[-1] == 1:
        kept = matrices > 1e-12 * np.finfo(float).tiny
        return np.where(kept, np.where(kept, matrices, 1.0) ** power, 0.0)
    values, vectors = np.linalg.eigh(matrices)
    kept = values > 1e-12 * np.maximum(values[..., -1:], np.finfo(float).tiny)
    raised = np.where(kept, np.where(kept, values, 1.0) ** power, 0.0)
    return np.asarray((vectors * raised[..., None, :]) @ _t(vectors))
