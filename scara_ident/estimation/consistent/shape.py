"""Which shape of friction the data allow: the strictest that they do not contradict, joint by joint.

Friction that only takes energy out may do anything beyond the speeds that were recorded. That of most gears also grows
with speed and ever less (the lubricated shape), which holds a short or slow recording to what a joint does at speed.
Whether a joint's data contradict it is asked of the friction parameters c of weighted least squares and of their
covariance V from blocks of time: the distance to the nearest parameters of that shape,

    T = min over A c0 >= 0 of (c - c0).T V^-1 (c - c0),

has under that shape, wherever in it c is, at most the upper bound of a mixture of squared normal deviates

    p = (P(T_{q-1} >= T) + P(T_q >= T)) / 2

with the q independent rows of A (Perlman 1969, "One-sided testing problems in multivariate analysis"; Kodde and Palm
1986, "Wald criteria for jointly testing equality and inequality restrictions"). T_q is Hotelling's statistic, as V is
itself estimated, with as many degrees of freedom as blocks that share in these parameters: the inverse sum of squares of
their shares, less one (as in Carter, Schnepel, Steigerwald 2017, "Asymptotic behavior of a t-test robust to cluster
heterogeneity"). Runs of one trajectory repeat what the model lacks, so that blocks at the same place of such runs count as
one, and the covariance grows where what they leave adds up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.estimation.consistent.friction import LUBRICATED
from scara_ident.estimation.consistent.options import ConsistentOptions, FrictionShape
from scara_ident.estimation.estimate import Estimate
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.run_offsets import beside_offsets
from scara_ident.model.terms.constraints import BrakingPolynomial

# A shape is contradicted where data such as these are this rare under it.
SIGNIFICANCE_LEVEL = 0.01
# Standard deviation of a parameter that the data leave open, over the size of all others.
OPEN = 1e6


@dataclass(frozen=True)
class ShapeChoice:
    """Which shape the friction of a joint was given, and why.

    Attributes
    ----------
    shape : {"lubricated", "dissipative", "free"}
    p_value : float or None
        Of the test that the data do not contradict the lubricated shape; None where nothing was tested.
    """

    joint: str
    shape: FrictionShape
    p_value: float | None
    why: str


def choose_shapes(
    polynomials: Sequence[BrakingPolynomial], options: ConsistentOptions, observations: Observations, plain: Estimate
) -> tuple[ShapeChoice, ...]:
    """Choose the shape of every joint's friction.

    Parameters
    ----------
    polynomials : sequence of BrakingPolynomial
        Of each joint, with columns counted in the model.
    plain : Estimate
        By weighted least squares, of the same observations.

    Returns
    -------
    tuple of ShapeChoice
        In the order of the polynomials.
    """
    found = []
    for polynomial in polynomials:
        asked = options.friction_of(polynomial.joint)
        if asked != "auto":
            found.append(ShapeChoice(polynomial.joint, asked, None, "as asked for"))
        elif not np.isfinite(polynomial.speed):
            why = "no velocity limit is known, up to which it would have to grow"
            found.append(ShapeChoice(polynomial.joint, "dissipative", None, why))
        else:
            p_value = lubricated_p_value(polynomial, observations, plain)
            contradicted = p_value < SIGNIFICANCE_LEVEL
            why = "the data contradict the lubricated shape" if contradicted else "the data do not contradict it"
            found.append(ShapeChoice(polynomial.joint, "dissipative" if contradicted else "lubricated", p_value, why))
    return tuple(found)


def lubricated_p_value(polynomial: BrakingPolynomial, observations: Observations, plain: Estimate) -> float:
    """Return how rare data such as these are where friction has the lubricated shape, at most.

    Parameters
    ----------
    polynomial : BrakingPolynomial
        With a velocity limit.
    plain : Estimate
        By weighted least squares, of the same observations.
    """
    from scipy.special import fdtrc

    columns, powers = list(polynomial.columns), np.array(polynomial.powers)
    # Torque at the velocity limit, so that the parameters have one unit.
    scale = polynomial.speed**powers
    value, covariance = (
        plain.value[columns] * scale,
        plain.covariance[np.ix_(columns, columns)] * np.outer(scale, scale),
    )
    rows = LUBRICATED[:, powers]
    rows = rows[np.any(rows != 0.0, axis=1)]
    statistic = distance_to_cone(rows, value, covariance)
    if statistic == 0.0:
        return 1.0
    shares = block_shares(observations, plain, columns)
    statistic, blocks = statistic / shares.repetition, shares.effective
    count = int(np.linalg.matrix_rank(rows))
    p_value = 0.0
    for size in (count - 1, count):
        freedom = blocks - size
        if freedom <= 0.0:
            return 1.0
        if size:
            p_value += 0.5 * float(fdtrc(size, freedom, statistic * freedom / ((blocks - 1.0) * size)))
    return p_value


def distance_to_cone(rows: Array, value: Array, covariance: Array) -> float:
    """Return the squared distance of a value from the cone where no row is negative, in the metric of a covariance.

    Parameters
    ----------
    rows : ndarray, shape (q, k)
    value : ndarray, shape (k,)
    covariance : ndarray, shape (k, k)
        Infinite variance: the value is not known at all.
    """
    from scipy.optimize import nnls

    known = np.isfinite(np.diag(covariance))
    spread = np.where(known[:, None] & known, covariance, 0.0)
    size = max(float(np.max(np.abs(value), initial=0.0)), float(np.sqrt(np.max(np.diag(spread), initial=0.0)))) or 1.0
    spread[np.diag_indices_from(spread)] += np.where(known, 0.0, (OPEN * size) ** 2)
    variances, vectors = np.linalg.eigh(spread)
    # What constraints or rounding leave without variance is as good as known, and no number is divided by 0.
    std = np.sqrt(np.maximum(variances, np.finfo(float).eps * size**2))
    whitened = (vectors.T @ value) / std
    # The nearest point is value + V A.T m with multipliers m >= 0 (Lawson, Hanson 1974, least distance programming).
    half = (vectors * std).T @ rows.T
    length = np.linalg.norm(half, axis=0)
    half = half / np.where(length > 0.0, length, 1.0)
    multipliers, _ = nnls(half, -whitened)
    return float(np.sum((half @ multipliers) ** 2))


@dataclass(frozen=True, eq=False)
class BlockShares:
    """What each block of time has to do with some parameters, those at the same place of a trajectory's runs together.

    Attributes
    ----------
    effective : float
        How many of them share in what is known: the inverse sum of their squared shares.
    repetition : float
        By how much the covariance grows where runs of one trajectory repeat what they leave, as they do where the model
        lacks something: scatter of the scores with repetitions added up over that without, at least 1.
    """

    effective: float
    repetition: float


def block_shares(observations: Observations, plain: Estimate, columns: Sequence[int]) -> BlockShares:
    """Return what the blocks of time have to do with some parameters of an estimate."""
    places = list(columns)
    inverse = plain.information.inverse()[places]
    size = np.sqrt(np.diag(inverse[:, places]))
    inverse = inverse / np.where(size > 0.0, size, 1.0)[:, None]
    shares = np.zeros((observations.blocks, len(places), len(places)))
    scores = np.zeros((observations.blocks, len(places)))
    # Beside offsets of runs, an estimate is moved by what these leave of the rows.
    influencing = beside_offsets(observations, plain.offsets).influence.joints
    for rows, weight in zip(influencing, plain.weights, strict=True):
        influence = weight * (inverse[:, rows.columns] @ rows.table[:-1])
        residual = weight * rows.left(plain.value)
        for b, (start, stop) in enumerate(pairwise(rows.starts)):
            shares[b] += influence[:, start:stop] @ influence[:, start:stop].T
            scores[b] += influence[:, start:stop] @ residual[start:stop]
    metric = np.linalg.pinv(np.sum(shares, axis=0), hermitian=True)
    group = _same_place(observations)
    part = np.bincount(group, np.einsum("ij,bji->b", metric, shares))
    together = np.zeros((len(part), len(places)))
    np.add.at(together, group, scores)
    one, added = (float(np.einsum("bi,ij,bj->", each, metric, each)) for each in (scores, together))
    total = float(np.sum(part))
    effective = total**2 / float(np.sum(part**2)) if total > 0.0 else 0.0
    return BlockShares(effective, max(1.0, added / one) if one > 0.0 else 1.0)


def _same_place(observations: Observations) -> NDArray[np.intp]:
    """Return a number for each block, the same for blocks at the same place of runs of one trajectory."""
    owner = observations.owner
    place = np.arange(len(owner)) - np.searchsorted(owner, owner)
    names = list(observations.data.labels)
    run = np.array([names.index(name) for name in names] or range(len(owner)), dtype=np.intp)[owner]
    return np.unique(np.column_stack([run, place]), axis=0, return_inverse=True)[1].ravel()
