"""Changes distinguished from noise as samples come in, with a false-alarm rate that is known.

Innovations, what the parameters so far leave of new torques, are white once they are divided by the root of their
covariance. Their scores along the causes that are looked for are averaged exponentially (MEWMA, Lowry, Woodall,
Champ and Rigdon 1992); an alarm is where the length of that vector passes a threshold. The length is a Markov chain, so that
the mean time between false alarms follows from an integral equation (Rigdon 1995), here on a grid; the threshold is the
one at which it is what was asked for.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from scara_ident.arrays import Array

# Grid of the length of the averaged vector, and how the search for its limit widens.
STATES = 160
WIDENING = 1.3
# Directions of the causes that a block does not tell from the others, as a share of the strongest.
DETERMINED = 1e-6


@dataclass(frozen=True)
class Alarm:
    """Something changed.

    Attributes
    ----------
    sample : int
        Samples taken in when it was seen; it is reported a window later, when more is known of what it is.
    effect : str
        The likeliest: ``friction``, ``torque_scale`` or ``payload_change``.
    joint : str or None
    size : float
        How large it would be alone, averaged over the detector's window: less than the whole.
    unit : str
        "1" for a share.
    strength : float
        Square of the averaged score's length over the threshold.
    """

    sample: int
    effect: str
    joint: str | None
    size: float
    unit: str
    strength: float


@dataclass(frozen=True, eq=False)
class Averages:
    """Averaged scores.

    Attributes
    ----------
    vector : ndarray, shape (c,)
        Of white scores, each of variance 1.
    scores : ndarray, shape (c,)
        Along each cause.
    information : ndarray, shape (c, c)
        Covariance of a block's scores.
    """

    vector: Array
    scores: Array
    information: Array

    @staticmethod
    def none(causes: int) -> Averages:
        """Return the averages before any block."""
        return Averages(np.zeros(causes), np.zeros(causes), np.zeros((causes, causes)))

    def after(self, scores: Array, information: Array, share: float) -> Averages:
        """Return the averages with a block of weight ``share``."""
        keep = 1.0 - share
        mixed = keep * self.information + share * information
        return Averages(
            keep * self.vector + share * white_scores(scores, information),
            keep * self.scores + share * scores,
            mixed,
        )

    def length(self, share: float) -> float:
        """Return the square of the vector's length in units of its variance in the long run."""
        return float(self.vector @ self.vector) * (2.0 - share) / share

    def likeliest(self) -> tuple[int, Array]:
        """Return the cause that explains most, and how large each would be alone, shape (c,)."""
        power = np.diag(self.information)
        sizes = np.where(power > 0.0, self.scores / np.where(power > 0.0, power, 1.0), 0.0)
        return int(np.argmax(self.scores * sizes)), sizes


def white_scores(scores: Array, information: Array) -> Array:
    """Return scores, shape (c,), with covariance ``information`` as c independent ones of variance 1.

    Along what a block does not tell nothing is returned that would move the average: there it is filled by nothing, and
    the alarm is the rarer for it.
    """
    size = np.sqrt(np.maximum(np.diag(information), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(information / np.outer(size, size))
    determined = values > DETERMINED * max(float(values[-1]), np.finfo(float).tiny)
    root = np.where(determined, 1.0 / np.sqrt(np.where(determined, values, 1.0)), 0.0)
    # The symmetric root keeps each score near its own cause from block to block.
    return np.asarray(vectors @ (root * (vectors.T @ (scores / size))))


@lru_cache(maxsize=32)
def threshold(causes: int, share: float, blocks: float) -> float:
    """Return the square of the length beyond which an alarm is, so that false ones are ``blocks`` blocks apart on average.

    Parameters
    ----------
    causes : int
        Dimension of the vector.
    share : float
        Weight of a new block, in (0, 1].
    blocks : float
    """
    low, high = 0.0, float(causes)
    # From below: far beyond, an alarm is rarer than rounding can tell.
    while mean_run(causes, share, high) < blocks:
        low, high = high, WIDENING * high
    while high - low > 1e-4 * high:
        middle = 0.5 * (low + high)
        if mean_run(causes, share, middle) < blocks:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def mean_run(causes: int, share: float, limit: float) -> float:
    """Return the mean number of blocks until the square of the length passes a limit, from a vector of zero."""
    from scipy.special import chdtr, gammaln

    # Lengths of the vector itself: limit is in units of its variance share / (2 - share).
    longest = np.sqrt(limit * share / (2.0 - share))
    edges = longest * np.arange(STATES + 1) / STATES
    middles = 0.5 * (edges[1:] + edges[:-1])
    middles[0] = 0.0
    # The next square is noncentral chi squared: a Poisson mixture of central ones.
    half = 0.5 * ((1.0 - share) * middles / share) ** 2
    terms = np.arange(int(half[-1] + 10.0 * np.sqrt(half[-1]) + 30.0))
    log = terms * np.log(np.maximum(half, np.finfo(float).tiny))[:, None] - half[:, None] - gammaln(terms + 1.0)
    below = np.exp(log) @ chdtr(causes + 2.0 * terms[:, None], (edges / share)[None] ** 2)
    return float(np.linalg.solve(np.eye(STATES) - np.diff(below, axis=1), np.ones(STATES))[0])
