"""How late effort is in each recording, pooled over all joints, and whether recordings differ in it.

One clock stamps the effort of all joints, so that a recording is late on all of them by the same time. What a model lacks on
one joint looks like a delay on that joint alone: other joints, whose torque changes as fast, show none. The delays that the
joints tell of each recording are pooled, and their disagreement is the measure of how sure the pooled ones are (DerSimonian
and Laird 1986; Hartung and Knapp 2001). A constant of each joint's own says nothing of that: parameters may have it.

Most of what a delay does lies in the few rows where Coulomb friction jumps. Friction that builds up over a distance, and a speed
whose sign noise turns, make that jump late too: how late it is is another kind of difference, and free. So is viscous friction,
which changes with temperature: of a slow motion the rate of the torque is much like its speed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array

# Probability below which chance does not make pooled delays differ, as `scara_ident.estimation.variance_components.LIKELIHOOD_RISE`.
CHANCE = 0.01
# Share of its own squares that a delay must have left beside other kinds of difference, or rounding is taken for it.
MIN_INDEPENDENT_SHARE = 1e-6


@dataclass(frozen=True, eq=False)
class SharedDelays:
    """Delays of recordings that all joints share.

    Attributes
    ----------
    of_run : ndarray, shape (runs,)
        By how much each is later than the mean of all, as sure as they are, s; NaN where a recording tells none. What all have alike
        parameters may have taken up.
    std : float
        Standard deviation of the recordings, s, beyond what makes the joints disagree.
    p_value : float
        That all recordings are late by the same time.
    share : float
        Rms torque that this standard deviation makes, as a share of a joint's, on the joint where that is largest.
    """

    of_run: Array
    std: float
    p_value: float
    share: float

    @property
    def differ(self) -> bool:
        """Whether the recordings differ beyond chance."""
        return self.p_value < CHANCE and self.std > 0.0


def shared_delays(
    products: Array,
    aims: Array,
    priors: Array,
    units: Array,
    kind: int,
    shares: Array,
    pieces: NDArray[np.intp] | None = None,
) -> SharedDelays | None:
    """Pool what joints tell of the delay of each recording.

    Parameters
    ----------
    products : ndarray, shape (joints, runs, kinds, kinds)
        Of the directions in which runs may differ, in units of the noise.
    aims : ndarray, shape (joints, runs, kinds)
        Of these with what is left.
    priors : ndarray, shape (joints, kinds)
        Variance of each kind between runs; 0 leaves it out, infinite leaves it free.
    units : ndarray, shape (joints,)
        Delay of one unit of its direction on each joint, s; 0 where a joint shows none.
    kind : int
        Place of the delay among the kinds.
    shares : ndarray, shape (joints,)
        Rms torque that one second of delay makes, as a share of each joint's.
    pieces : ndarray of int, shape (runs,), optional
        Of which recording each run is a piece: pieces of one have one clock, and one delay.

    Returns
    -------
    SharedDelays or None
        None where fewer than two recordings tell a delay.
    """
    late, precision = _of_each(products, aims, priors, units, kind)
    if pieces is None:
        return _pooled(late, precision, shares)
    places, place = np.unique(pieces, return_inverse=True)
    of_piece = np.eye(len(places))[place]
    total = precision @ of_piece
    late = np.divide((precision * late) @ of_piece, total, out=np.zeros_like(total), where=total > 0.0)
    found = _pooled(late, total, shares)
    return None if found is None else replace(found, of_run=found.of_run[place])


def _pooled(late: Array, precision: Array, shares: Array) -> SharedDelays | None:
    """Pool delays of recordings and their precision, shape (joints, runs) each."""
    determined = np.sum(precision, axis=0) > 0.0
    if np.count_nonzero(determined) < 2:
        return None
    joints = np.sum(precision, axis=1) > 0.0
    late, precision = late[np.ix_(joints, determined)], precision[np.ix_(joints, determined)]
    whole, weight = np.sum(precision, axis=1), np.sum(precision, axis=0)
    alone = np.sum(precision * late, axis=1) / whole
    # What is left of the runs' own precision once every joint has a constant of its own, and what it is aimed at.
    between = np.diag(weight) - precision.T @ (precision / whole[:, None])
    aim = np.sum(precision * (late - alone[:, None]), axis=0)
    off = np.linalg.pinv(between, hermitian=True) @ aim
    apart, own = float(off @ aim), len(weight) - 1
    freedom = int(np.count_nonzero(precision)) - own - len(whole)
    disagreement = float(np.sum(precision * (late - alone[:, None]) ** 2)) - apart
    scatter = max(1.0, disagreement / freedom) if freedom > 0 else 1.0
    std = float(np.sqrt(max(0.0, apart - own * scatter) / np.trace(between)))
    of_run = np.full(len(determined), np.nan)
    of_run[determined] = off - np.sum(weight * off) / np.sum(weight)
    chance = _chance(apart / scatter, own, freedom)
    return SharedDelays(of_run, std, chance, std * float(np.max(shares)))


def _chance(apart: float, own: int, freedom: int) -> float:
    """Return the probability of squares between recordings that are so many times what they would be by chance."""
    from scipy.special import chdtrc, fdtrc

    return float(fdtrc(own, freedom, apart / own) if freedom > 0 else chdtrc(own, apart))


def _of_each(products: Array, aims: Array, priors: Array, units: Array, kind: int) -> tuple[Array, Array]:
    """Return the delay that each joint tells of each recording, s, and its precision, 1/s^2, shape (joints, runs) each."""
    joints, runs = aims.shape[:2]
    late, precision = np.zeros((joints, runs)), np.zeros((joints, runs))
    for joint in range(joints):
        beside = [k for k in range(len(priors[joint])) if k != kind and priors[joint, k] > 0.0]
        known = np.diag(1.0 / priors[joint, beside])
        for run in range(runs if units[joint] > 0.0 else 0):
            own, aim = products[joint, run], aims[joint, run]
            inner = np.linalg.pinv(own[np.ix_(beside, beside)] + known, hermitian=True)
            reach = own[kind, beside] @ inner
            left = own[kind, kind] - reach @ own[beside, kind]
            if left > MIN_INDEPENDENT_SHARE * own[kind, kind]:
                late[joint, run] = units[joint] * (aim[kind] - reach @ aim[beside]) / left
                precision[joint, run] = left / units[joint] ** 2
    return late, precision
