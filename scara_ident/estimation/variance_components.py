"""Variance components of runs by restricted maximum likelihood, on all joints at once.

Each run lies off the mean along some directions, of which its rows tell with a known precision. What is left of a fit shows
fewer draws of them than there are runs: parameters take up the others (Patterson and Thompson 1971). The variances are found
by expectation and maximisation (Searle, Casella and McCulloch 1992, "Variance Components", section 8.3). Kinds that chance
explains are left out one by one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array

# Rise of twice the logarithm of the likelihood below which chance explains a component, which cannot be negative: 1 %.
LIKELIHOOD_RISE = 5.41
# Steps of expectation and maximisation; each takes a share of what is left.
STEPS = 40


def differing(products: Array, aims: Array, kept: NDArray[np.bool_], draws: Array) -> NDArray[np.bool_]:
    """Return which kinds differ on each joint by more than chance explains, shape (joints, kinds).

    Kinds are left out one by one.

    Parameters
    ----------
    products : ndarray, shape (joints, runs, kinds, kinds)
    aims : ndarray, shape (joints, runs, kinds)
    kept : ndarray of bool, shape (joints, kinds)
        Kinds that may differ.
    draws : ndarray, shape (joints, kinds)
        How many draws of each kind parameters leave, of as many as there are runs.
    """
    kinds = kept.shape[1]
    # Every set of kinds that may be left, in the same steps: bit k of its place says whether kind k is in it.
    sets = (np.arange(2**kinds)[:, None] >> np.arange(kinds)) & 1 == 1
    variances, likelihoods = _max_likely(products, aims, kept[:, None] & sets, draws)
    found = np.zeros(kept.shape, dtype=bool)
    for joint, own in enumerate(kept):
        place = int(np.sum(1 << np.flatnonzero(own)))
        while place:
            fewer = [place & ~(1 << kind) for kind in range(kinds) if place >> kind & 1]
            likeliest = max(fewer, key=lambda other: float(likelihoods[joint, other]))
            if not 2.0 * (likelihoods[joint, place] - likelihoods[joint, likeliest]) <= LIKELIHOOD_RISE:
                break
            place = likeliest
        found[joint] = variances[joint, place] > 0.0
    return found


def components(products: Array, aims: Array, kept: NDArray[np.bool_], draws: Array) -> Array:
    """Return the variance of each kind on each joint, shape (joints, kinds); 0 for kinds that are not kept.

    Parameters
    ----------
    products, aims, kept, draws
        See `differing`.
    """
    return _max_likely(products, aims, kept[:, None], draws)[0][:, 0] if np.any(kept) else np.zeros(kept.shape)


def expected(products: Array, aims: Array, variance: Array) -> tuple[Array, Array]:
    """Return how far each run lies off along each direction, and the variance of that.

    Parameters
    ----------
    products : ndarray, shape (..., runs, k, k)
    aims : ndarray, shape (..., runs, k)
    variance : ndarray, shape (..., k)
        Zero leaves a direction out.

    Returns
    -------
    tuple of ndarray, each of shape (..., runs, k)
    """
    mean, spread = _expected(*_kinds_first(products, aims), np.moveaxis(variance, -1, 0))
    return np.moveaxis(mean, 0, -1), np.moveaxis(spread, 0, -1)


def _kinds_first(products: Array, aims: Array) -> tuple[Array, Array]:
    """Return products and aims with the axes of kinds first, so that those of all runs are worked on together."""
    first = np.moveaxis(products, (-2, -1), (0, 1)), np.moveaxis(aims, -1, 0)
    return np.ascontiguousarray(first[0]), np.ascontiguousarray(first[1])


def _expected(products: Array, aims: Array, variance: Array) -> tuple[Array, Array]:
    """Do what `expected` does, of products (k, k, ..., runs), aims (k, ..., runs) and variances (k, ...)."""
    root = np.sqrt(variance)[..., None]
    roots = root[:, None] * root
    inner = products * roots
    kinds = np.arange(len(inner))
    inner[kinds, kinds] += 1.0
    spread = _inverted(inner)
    spread *= roots
    return np.add.reduce(spread * aims, axis=1), spread[kinds, kinds]


def _inverted(matrices: Array) -> Array:
    """Invert matrices (k, k, ...) where they are, and return them.

    Gauss and Jordan without a choice of pivots, which a unit matrix plus a positive one does not need: of many of four rows it
    takes half the time of `numpy.linalg.inv`, which is most of the time of all steps.
    """
    for place in range(len(matrices)):
        pivot = 1.0 / matrices[place, place]
        column = matrices[:, place].copy()
        column[place] = 0.0
        row = matrices[place] * pivot
        matrices -= column[:, None] * row
        matrices[place] = row
        np.multiply(column, -pivot, out=matrices[:, place])
        matrices[place, place] = pivot
    return matrices


def _max_likely(products: Array, aims: Array, active: NDArray[np.bool_], draws: Array) -> tuple[Array, Array]:
    """Return the variances that are most likely, and the logarithm of their likelihood, for sets of active kinds.

    Parameters
    ----------
    products : ndarray, shape (joints, runs, k, k)
    aims : ndarray, shape (joints, runs, k)
    active : ndarray of bool, shape (joints, sets, k)
        The variances of the others are zero.
    draws : ndarray, shape (joints, k)

    Returns
    -------
    tuple of ndarray, shapes (joints, sets, k) and (joints, sets)
    """
    products, aims = _kinds_first(products[:, None], aims[:, None])
    active, draws = np.moveaxis(active, -1, 0), draws.T[..., None]
    kinds = np.arange(len(active))
    # The first guess leaves nothing to chance.
    guess = np.mean((aims / np.maximum(products[kinds, kinds], np.finfo(float).tiny)) ** 2, axis=-1)
    variance = np.where(active, guess, 0.0)
    for _ in range(STEPS):
        mean, spread = _expected(products, aims, variance)
        # A draw that is taken up stays as unsure as it was.
        variance = np.add.reduce(mean * mean, axis=-1) / draws + np.mean(spread, axis=-1)
    root = np.sqrt(variance)[..., None]
    grown = np.moveaxis(products * (root[:, None] * root), (0, 1), (-2, -1)) + np.eye(len(active))
    mean, _ = _expected(products, aims, variance)
    taken = (1.0 - draws / mean.shape[-1])[..., None] * np.log1p(products[kinds, kinds] * root**2)
    volume = np.sum(np.linalg.slogdet(grown)[1], axis=-1) - np.sum(taken, axis=(0, -1))
    likelihood = 0.5 * np.sum(mean * aims, axis=(0, -1)) - 0.5 * volume
    return np.moveaxis(variance, 0, -1), likelihood
