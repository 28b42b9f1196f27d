"""Variance components of runs by maximum likelihood, on all joints at once.

Each run lies off the mean along some directions, of which its rows tell with a known precision. The variances are found
by expectation and maximisation (Searle, Casella and McCulloch 1992, "Variance Components", section 8.3), and kinds that
chance explains are left out one by one.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array

# Rise of twice the logarithm of the likelihood below which chance explains a component, which cannot be negative: 1 %.
CHANCE = 5.41
# Steps of expectation and maximisation; each takes a share of what is left.
STEPS = 40


def components(products: Array, aims: Array, kept: NDArray[np.bool_]) -> Array:
    """Return the variance of each kind on each joint, shape (joints, kinds); 0 where chance explains it.

    Kinds are left out one by one.

    Parameters
    ----------
    products : ndarray, shape (joints, runs, kinds, kinds)
    aims : ndarray, shape (joints, runs, kinds)
    kept : ndarray of bool, shape (joints, kinds)
        Kinds that may differ.
    """
    kinds = kept.shape[1]
    # Every set of kinds that may be left, in the same steps: bit k of its place says whether kind k is in it.
    sets = (np.arange(2**kinds)[:, None] >> np.arange(kinds)) & 1 == 1
    variances, likelihoods = _most_likely(products, aims, kept[:, None] & sets)
    found = np.zeros(kept.shape)
    for joint, own in enumerate(kept):
        place = int(np.sum(1 << np.flatnonzero(own)))
        while place:
            fewer = [place & ~(1 << kind) for kind in range(kinds) if place >> kind & 1]
            likeliest = max(fewer, key=lambda other: float(likelihoods[joint, other]))
            if not 2.0 * (likelihoods[joint, place] - likelihoods[joint, likeliest]) <= CHANCE:
                break
            place = likeliest
        found[joint] = variances[joint, place]
    return found


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
    root = np.sqrt(variance)[..., None, :]
    roots = root[..., :, None] * root[..., None, :]
    inner = products * roots
    inner += np.eye(inner.shape[-1])
    spread = np.linalg.inv(inner)
    spread *= roots
    return (spread @ aims[..., None])[..., 0], np.einsum("...kk->...k", spread)


def _most_likely(products: Array, aims: Array, active: NDArray[np.bool_]) -> tuple[Array, Array]:
    """Return the variances that are most likely, and the logarithm of their likelihood, for sets of active kinds.

    Parameters
    ----------
    products : ndarray, shape (joints, runs, k, k)
    aims : ndarray, shape (joints, runs, k)
    active : ndarray of bool, shape (joints, sets, k)
        The variances of the others are zero.

    Returns
    -------
    tuple of ndarray, shapes (joints, sets, k) and (joints, sets)
    """
    products, aims = products[:, None], aims[:, None]
    alone = np.diagonal(products, axis1=-2, axis2=-1)
    # The first guess leaves nothing to chance.
    guess = np.mean((aims / np.maximum(alone, np.finfo(float).tiny)) ** 2, axis=-2)
    variance = np.where(active, guess, 0.0)
    for _ in range(STEPS):
        mean, spread = expected(products, aims, variance)
        variance = np.add.reduce(mean * mean + spread, axis=-2) / mean.shape[-2]
    root = np.sqrt(variance)[..., None, :]
    grown = np.eye(guess.shape[-1]) + products * (root[..., :, None] * root[..., None, :])
    mean, _ = expected(products, aims, variance)
    likelihood = 0.5 * np.sum(mean * aims, axis=(-2, -1)) - 0.5 * np.sum(np.linalg.slogdet(grown)[1], axis=-1)
    return variance, likelihood
