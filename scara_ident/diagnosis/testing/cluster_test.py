"""Cluster-robust tests of coefficients that are valid with few blocks and correlated residuals.

Each block of time is a cluster. The coefficients without a block follow in closed form from small products (delete-one
jackknife, in which all parameters of the model are fitted again), and their scatter gives the covariance. It is scaled
to be unbiased for white residuals. Its degrees of freedom are those of Satterthwaite, from the part of the candidate's
own column outside the model: a column that acts in three blocks has about two, however many blocks there are (Bell and McCaffrey 2002; Pustejovsky and Tipton 2018; MacKinnon, Nielsen and Webb
2023). Neighbouring blocks are included with Bartlett's kernel (Newey and West 1987), which reduces the degrees of
freedom too.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.diagnosis.testing.balance import BENDS, Weighted, power, shares_of, weighted
from scara_ident.diagnosis.testing.fitted_model import FittedModel, Products

# Share of a direction that the other blocks must contain, otherwise it cannot be tested without this block.
_MIN_REDUNDANCY = 1e-6
# With fewer degrees of freedom than this for several coefficients, one direction alone is tested too.
FEW_FREEDOM = 10.0
# Blocks are weighted if one contains more than this share of a direction: more than all others together.
MAX_BLOCK_SHARE = 0.5
# Weights of blocks are chosen for a probability as required of one candidate of about two hundred.
TYPICAL_LEVEL = 1e-5
# With fewer degrees of freedom no size is significant: it would need millions of standard errors.
MIN_FREEDOM = 0.1
# Directions of a few columns below this share of the largest are not tested.
_RANK = 1e-9
# Squares of columns below this count as zero: the inverse of less overflows.
_MIN_SQUARE = 1e-200


@dataclass(frozen=True, eq=False)
class ClusterTest:
    """Of g candidates with k columns each.

    Attributes
    ----------
    p_value : ndarray, shape (g,)
        That all coefficients of a candidate are zero.
    value : ndarray, shape (g, k)
        The coefficients that were tested: those of least squares, or by weighted blocks (see `balance`).
    covariance : ndarray, shape (g, k, k)
        Of these.
    freedom : ndarray, shape (g,)
        Degrees of freedom of the covariance; 0 where it is not known.
    """

    p_value: Array
    value: Array
    covariance: Array
    freedom: Array


def cluster_test(
    model: FittedModel, products: Products, whole: Array, value: Array, scores: Array, columns: Array
) -> ClusterTest:
    """Test coefficients against the scatter of the scores of blocks.

    Parameters
    ----------
    products : Products
        Of the candidates.
    whole : ndarray, shape (g, k, k)
        Products of what lies outside the model, over all blocks.
    value : ndarray, shape (g, k)
        Coefficients when a candidate is added to the model.
    scores : ndarray, shape (g, blocks, k)
        Products of what lies outside the model with the residual that the model with the candidate leaves.
    columns : ndarray, shape (g, blocks, k, k)
        Products of what lies outside the model, block by block.
    """
    into, back, rank = _whitening(whole)
    left = model.basis_scores - np.einsum("gbkr,gk->gbr", products.cross, value)
    reach = model.reaching(products.cross)
    score = np.einsum("gki,gbk->gbi", into, scores + np.einsum("gbkr,gbr->gbk", reach, left))
    release, own, links, strength = _without_blocks(into, reach, products.cross, columns)
    # What leaving a block out changes, and what that follows from where residuals are white.
    change = np.einsum("gbij,gbj->gbi", release, score)
    neighbours = _Neighbours.of(model)
    pairs = neighbours.pairs(change)
    # In a block nothing is left of its products with itself: `own` is what it has less these.
    negative = np.full(links.shape[-1], -1.0)
    expected, freedom = _if_white(neighbours, own + links @ links.transpose(0, 1, 3, 2), links, negative)
    scale = _inverse_root(expected)
    unbiased = scale @ np.einsum("gpi,gpj->gij", pairs, pairs) @ scale
    whitened = np.einsum("gij,gj->gi", back, value)
    known = np.all(strength > _MIN_REDUNDANCY, axis=(1, 2))
    # What one block alone holds has no scatter of its own, and a covariance of rounding alone.
    least = np.where(known, _least(freedom), 0.0)
    together = _hotelling(whitened, unbiased, least, rank)
    few = (rank > 1) & (least - rank + 1.0 < FEW_FREEDOM)
    p_value = np.where(few, _either(together, whitened, unbiased, freedom, rank), together)
    result = ClusterTest(np.where(known, p_value, 1.0), value, into @ unbiased @ into.transpose(0, 2, 1), least)
    return _balanced(model, replace(products, columns=columns, scores=scores), result, (into, back, rank))


def _balanced(
    model: FittedModel,
    products: Products,
    result: ClusterTest,
    whitening: tuple[Array, Array, NDArray[np.intp]],
) -> ClusterTest:
    """Return a test, of little freedom made by weighted blocks where effects can then be smaller and still significant."""
    into, back, rank = whitening
    places, weights, _ = _weights(model, products, (into, rank), result.freedom, TYPICAL_LEVEL)
    if not len(places):
        return result
    into, few = into[places], _whitened(products, into, places)
    found = weighted(model, few, weights)
    expected, freedom = _of_weighted(_Neighbours.of(model), found)
    # As if nothing of the candidate were in the model.
    start = np.einsum("gij,gj->gi", back[places], result.value[places])
    scores = np.einsum("gki,gbk->gbi", into, products.scores[places]) + np.einsum("gbij,gj->gbi", few.columns, start)
    scores = weights[..., None] * (scores - np.einsum("gkr,br->gbk", found.spanned, model.basis_scores))
    inverse = np.linalg.pinv(np.sum(found.own, axis=1))
    value = np.einsum("gij,gj->gi", inverse, np.sum(scores, axis=1))
    scores -= np.einsum("gbij,gj->gbi", found.own, value)
    left = model.basis_scores - np.einsum("gbkr,gk->gbr", few.cross, value)
    change = np.einsum("gbij,gbj->gbi", found.release, scores + np.einsum("gbkr,gbr->gbk", found.reach, left))
    pairs = _Neighbours.of(model).pairs(change)
    scale = into @ power(found.spread, 0.5) @ _inverse_root(expected) @ power(found.spread, -0.5)
    covariance = scale @ np.einsum("gpi,gpj->gij", pairs, pairs) @ scale.transpose(0, 2, 1)
    tested, least = np.einsum("gki,gi->gk", into, value), _least(freedom)
    whole = np.sum(products.columns[places], axis=1)
    p_value = [significance(*each) for each in zip(tested, covariance, least, whole, strict=True)]
    # What all rows say must not be the opposite.
    agrees = np.einsum("gi,gij,gj->g", tested, whole, result.value[places]) > 0.0
    new = ClusterTest(np.where(agrees, p_value, 1.0), tested, covariance, least)
    both = {name: np.array(held) for name, held in vars(result).items()}
    for name, held in vars(new).items():
        both[name][places] = held
    return ClusterTest(**both)


def _weights(
    model: FittedModel, products: Products, whitening: tuple[Array, NDArray[np.intp]], freedom: Array, chance: float
) -> tuple[NDArray[np.intp], Array, Array]:
    """Return which candidates need less by weighted blocks, their weights, and what all need, see `min_sizes`."""
    into, rank = whitening
    sizes = np.array([needed(k, v, chance) if k else np.inf for k, v in zip(rank, freedom, strict=True)])
    places = np.flatnonzero((freedom < FEW_FREEDOM) & (rank > 0))
    few = _whitened(products, into, places)
    if len(places):
        places = places[np.max(shares_of(model, few, np.ones(few.columns.shape[:2])), axis=1) > MAX_BLOCK_SHARE]
        few = _whitened(products, into, places)
    weights, bent = np.ones(few.columns.shape[:2]), np.zeros(len(places), dtype=bool)
    each = weights
    neighbours = _Neighbours.of(model)
    for bend in BENDS if len(places) else ():
        # What the model leaves of the columns follows from the weights, and these from that.
        each = 1.0 / (1.0 + shares_of(model, few, each) / bend)
        found = weighted(model, few, each)
        least = _least(_of_weighted(neighbours, found)[1])
        # What the weighted blocks do not tell has no spread, and what rounding leaves of it may be less than nothing.
        square = np.trace(found.spread, axis1=1, axis2=2)
        determined = (found.strength > _MIN_REDUNDANCY) & (square > 0.0)
        spread = np.sqrt(np.where(determined, square, np.inf) / rank[places])
        size = spread * [needed(k, v, chance) for k, v in zip(rank[places], least, strict=True)]
        better = size < sizes[places]
        sizes[places[better]], weights[better], bent[better] = size[better], each[better], True
    return places[bent], weights[bent], sizes


def _whitened(products: Products, into: Array, places: NDArray[np.intp]) -> Products:
    """Return the products of some candidates in units in which those of all blocks are the identity."""
    into = into[places]
    cross = into.transpose(0, 2, 1)[:, None] @ products.cross[places]
    return replace(products, columns=_both_sides(into, products.columns[places]), cross=cross)


def _of_weighted(neighbours: _Neighbours, found: Weighted) -> tuple[Array, Array]:
    """Return `_if_white` of weighted blocks, in units in which their coefficients' covariance is the identity."""
    turn = power(found.spread, -0.5)[:, None]
    return _if_white(neighbours, turn @ found.alone @ turn, turn @ found.links, found.signs)


def min_sizes(model: FittedModel, products: Products, chance: float) -> Array:
    """Return the standard errors of least squares at which candidates become significant, shape (g,); no torque takes part.

    Where residuals are white of variance one; the test by weighted blocks takes more of its own, and fewer of these.
    """
    into, _, rank = _whitening(np.sum(products.columns, axis=1))
    reach = model.reaching(products.cross)
    _, own, links, strength = _without_blocks(into, reach, products.cross, products.columns)
    alone = own + links @ links.transpose(0, 1, 3, 2)
    _, freedom = _if_white(_Neighbours.of(model), alone, links, np.full(links.shape[-1], -1.0))
    least = np.where(np.all(strength > _MIN_REDUNDANCY, axis=(1, 2)), _least(freedom), 0.0)
    return _weights(model, products, (into, rank), least, chance)[2]


def needed(count: int, freedom: float, chance: float) -> float:
    """Return the standard errors at which coefficients become significant, the inverse of `significance`.

    Parameters
    ----------
    count : int
        Coefficients k.
    freedom : float
        Degrees of freedom of their covariance.
    chance : float
        The probability asked for.

    Returns
    -------
    float
        Root of Wald's statistic, infinite where no size is significant.
    """
    from scipy.special import fdtri

    if freedom < MIN_FREEDOM:
        return np.inf
    rest = freedom - count + 1.0
    few = count > 1 and rest < FEW_FREEDOM
    share = 0.5 * chance if few else chance
    together = np.sqrt(fdtri(count, rest, 1.0 - share) * freedom * count / rest) if rest > MIN_FREEDOM else np.inf
    alone = np.sqrt(fdtri(1.0, freedom, 1.0 - share / count)) if few and freedom > 0.0 else np.inf
    return float(min(together, alone))


def surely_needed(count: int, chance: float) -> float:
    """Return the standard errors that `needed` is at least, however much freedom there is."""
    from scipy.special import chdtri

    return float(np.sqrt(chdtri(count, chance)))


def _least(freedom: Array) -> Array:
    """Return that of the direction of which least is known; one without any column takes no part."""
    least = np.min(freedom, axis=1)
    return np.where(np.isfinite(least), least, 1.0)


def _without_blocks(into: Array, reach: Array, cross: Array, columns: Array) -> tuple[Array, Array, Array, Array]:
    """Return how a block's scores move the coefficients once it is left out, with its products, links and redundancy."""
    inside = _both_sides(into, columns + reach @ cross.transpose(0, 1, 3, 2))
    if inside.shape[-1] == 1:
        strength = 1.0 - inside[..., 0]
        release = 1.0 / np.maximum(strength, _MIN_REDUNDANCY)[..., None]
    else:
        strength, turn = np.linalg.eigh(np.eye(inside.shape[-1]) - inside)
        release = (turn / np.maximum(strength, _MIN_REDUNDANCY)[..., None, :]) @ turn.transpose(0, 1, 3, 2)
    own = release @ inside
    links = np.concatenate([(release @ into.transpose(0, 2, 1)[:, None]) @ reach, own], axis=-1)
    return release, own, links, strength


def significance(value: Array, covariance: Array, freedom: float, products: Array) -> float:
    """Return the probability that coefficients of no size would be as large, Hotelling's test, or `_either`.

    Parameters
    ----------
    value : ndarray, shape (k,)
    covariance : ndarray, shape (k, k)
    freedom : float
        Degrees of freedom of the covariance.
    products : ndarray, shape (k, k)
        Products of what the model leaves of the candidate's columns, which say the directions that can be asked alone.
    """
    if not np.all(np.isfinite(covariance)):
        return 1.0
    _, back, rank = _whitening(products[None])
    whitened, spread = back @ value, back @ covariance[None] @ back.transpose(0, 2, 1)
    each = np.full(whitened.shape, freedom)
    together = _hotelling(whitened, spread, each[:, 0], rank)
    few = (rank > 1) & (freedom - rank + 1.0 < FEW_FREEDOM)
    return float(np.where(few, _either(together, whitened, spread, each, rank), together)[0])


def _either(together: Array, value: Array, covariance: Array, freedom: Array, rank: NDArray[np.intp]) -> Array:
    """Return p-values of several coefficients together or of the most significant direction alone, shape (g,).

    Where blocks are few, several together leave hardly any freedom, and one alone may be beyond doubt (Bonferroni).
    """
    from scipy.special import fdtrc

    variance = np.diagonal(covariance, axis1=1, axis2=2)
    some = (variance > 0.0) & np.isfinite(freedom)
    each = np.where(some, value**2 / np.where(some, variance, 1.0), 0.0)
    alone = np.where(some, fdtrc(1.0, np.where(some, freedom, 1.0), each), 1.0)
    return np.asarray(np.minimum(1.0, 2.0 * np.minimum(together, rank * np.min(alone, axis=1))))


def _hotelling(value: Array, covariance: Array, freedom: Array, rank: NDArray[np.intp]) -> Array:
    """Return p-values of Hotelling's T-squared, which is Student's t where there is one coefficient, shape (g,)."""
    from scipy.special import fdtrc

    wald = np.einsum("gi,gij,gj->g", value, np.linalg.pinv(covariance, rcond=_RANK, hermitian=True), value)
    second = freedom - rank + 1.0
    tested = (second > 0.0) & (rank > 0)
    second, first, freedom = np.where(tested, second, 1.0), np.maximum(rank, 1), np.where(tested, freedom, 1.0)
    ratio = np.maximum(wald, 0.0) * second / (freedom * first)
    return np.where(tested, fdtrc(first, second, ratio), 1.0)


def _whitening(whole: Array) -> tuple[Array, Array, NDArray[np.intp]]:
    """Return A with ``A' W A = 1`` where W says something, its inverse there, and in how many directions that is."""
    # Of a column within the model rounding may leave less than nothing.
    squares = np.diagonal(whole, axis1=1, axis2=2)
    size = np.sqrt(np.where(squares > _MIN_SQUARE, squares, 1.0))
    values, vectors = np.linalg.eigh(whole / (size[:, :, None] * size[:, None, :]))
    kept = (values > _RANK * values[:, -1:]) & (values > _MIN_SQUARE)
    root = np.sqrt(np.where(kept, values, 1.0))
    into = np.where(kept[:, None], vectors / root[:, None] / size[:, :, None], 0.0)
    back = np.where(kept[:, None], vectors * root[:, None] * size[:, :, None], 0.0)
    return into, back.transpose(0, 2, 1), np.sum(kept, axis=1, dtype=np.intp)


def _both_sides(into: Array, products: Array) -> Array:
    return np.asarray(into.transpose(0, 2, 1)[:, None] @ products @ into[:, None])


def _inverse_root(matrix: Array) -> Array:
    values, vectors = np.linalg.eigh(matrix)
    kept = values > _RANK * np.maximum(values[:, -1:], np.finfo(float).tiny)
    root = np.where(kept, 1.0 / np.sqrt(np.where(kept, values, 1.0)), 0.0)
    return np.asarray((vectors * root[:, None]) @ vectors.transpose(0, 2, 1))


@dataclass(frozen=True, eq=False)
class _Neighbours:
    """Pairs of blocks that follow each other in a recording; its first and last block make a pair with nothing.

    Bartlett's weights of a half for neighbours are half the sum of the squares of these pairs.

    Attributes
    ----------
    runs : tuple of (slice, slice)
        Of each recording its blocks, and the pairs in which they are the later ones; they are the earlier ones in the next.
    count : int
        Number of pairs.
    """

    runs: tuple[tuple[slice, slice], ...]
    count: int

    @staticmethod
    def of(model: FittedModel) -> _Neighbours:
        """Return the pairs of a model's blocks."""
        bounds = [0, *(np.flatnonzero(np.diff(model.owner)) + 1).tolist(), len(model.owner)]
        runs = [(slice(a, b), slice(a + k, b + k)) for k, (a, b) in enumerate(pairwise(bounds))]
        return _Neighbours(tuple(runs), len(model.owner) + len(runs))

    def pairs(self, signals: Array) -> Array:
        """Return the sums of pairs over the square root of two, of signals of shape (g, blocks, ...)."""
        half = np.sqrt(0.5) * signals
        found = np.zeros((len(signals), self.count, *signals.shape[2:]))
        for blocks, later in self.runs:
            found[:, later] = half[:, blocks]
            found[:, later.start + 1 : later.stop + 1] += half[:, blocks]
        return found

    def back(self, pairs: Array) -> Array:
        """Apply the transpose of `pairs`."""
        found = np.empty((len(pairs), self.count - len(self.runs), *pairs.shape[2:]))
        for blocks, later in self.runs:
            np.add(pairs[:, later], pairs[:, later.start + 1 : later.stop + 1], out=found[:, blocks])
        found *= np.sqrt(0.5)
        return found


def _if_white(neighbours: _Neighbours, alone: Array, links: Array, signs: Array) -> tuple[Array, Array]:
    """Return what the scatter is expected to be where residuals are white of variance one, and its freedom.

    The changes of blocks b and c have the covariance ``links_b diag(signs) links_c'``, and that of a block with itself has
    ``alone_b`` in addition. Satterthwaite: the freedom of a direction is the squared trace of the covariance of all over
    its squared norm; infinite where a candidate has no column in it.

    Parameters
    ----------
    alone : ndarray, shape (g, blocks, k, k)
    links : ndarray, shape (g, blocks, k, m)
    signs : ndarray, shape (m,)
    """
    paired = neighbours.pairs(links)
    back, across = neighbours.back(paired), paired.transpose(0, 2, 1, 3)
    signed = signs * across
    # A pair holds half of the square of either block.
    flat = (len(paired), paired.shape[2], -1)
    expected = np.sum(alone, axis=1) + signed.reshape(flat) @ across.reshape(flat).transpose(0, 2, 1)
    size = np.diagonal(alone, axis1=2, axis2=3)
    diagonal = np.sqrt(0.5) * neighbours.pairs(size)
    norm = np.sum(diagonal**2, axis=1) + 0.5 * np.sum(size**2, axis=1)
    norm += 2.0 * np.sum(size * (back**2 @ signs), axis=1)
    if across.shape[2] < across.shape[3]:
        norm += np.sum((across @ signed.transpose(0, 1, 3, 2)) ** 2, axis=(2, 3))
    else:
        norm += (across.transpose(0, 1, 3, 2) @ across) ** 2 @ signs @ signs
    trace = np.diagonal(expected, axis1=1, axis2=2)
    shown = (trace > 0.0) & (norm > 0.0)
    freedom = np.where(shown, trace**2 / np.where(shown, norm, 1.0), np.inf)
    return expected, freedom
