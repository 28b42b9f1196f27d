"""How often a score exceeds a high level: the peaks-over-threshold law of its clusters.

Peaks follow a generalised Pareto law (peaks over threshold: Davison and Smith, "Models for exceedances over high thresholds",
JRSS B 52, 1990; Coles, *An Introduction to Statistical Modeling of Extreme Values*, 2001, chapters 4 and 5). Its shape and
width are known only so well, and it may end: what is stated is the mean over all laws that the peaks leave possible, the
predictive rate (Coles, chapter 9), with a prior of the shape as by Martins and Stedinger, Water Resources Research 36, 2000.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array

# Exceedances closer than this, s, are one cluster, and one alarm.
CLUSTER_SECONDS = 0.5
# Clusters that the tail is fitted to, if there are as many: a share of the seconds recorded, within bounds.
CLUSTER_SHARE, MIN_CLUSTERS, MAX_CLUSTERS = 0.1, 20, 400
# Levels that are tried for that.
LEVELS = 30
# There must be so many clusters for each that the stated rate makes: the level is looked for above where the tail begins.
CLUSTERS_OVER_RATE = 2.0
# Shapes of the tail, from the uniform law's to one without variance, none of them 0; widths that are tried with each, in their
# standard deviations about what the mean asks for; and the standard deviation of the shape before anything is seen.
SHAPES, WIDTHS = np.linspace(-1.0, 0.5, 30), np.linspace(-5.0, 5.0, 31)
PRIOR = 0.2
# Laws less likely than this against all others are left out.
MIN_WEIGHT = 1e-6
# Share of a level to which it is found.
PRECISION = 1e-10
HOUR = 3600.0


@dataclass(frozen=True, eq=False)
class Tail:
    """Generalised Pareto laws of the peaks of clusters above a level ``start``, each with its probability.

    Attributes
    ----------
    start : float
    width, shape, weight : ndarray, shape (m,)
        No shape is 0; the weights sum to 1.
    clusters : int
    hours : float
    """

    start: float
    width: Array
    shape: Array
    weight: Array
    clusters: int
    hours: float

    @property
    def mean_shape(self) -> float:
        """The mean of the shapes."""
        return float(self.weight @ self.shape)

    def rate(self, level: float) -> float:
        """Return how often an hour peaks exceed a level, the mean over the laws: 0 only beyond where all of them end."""
        return self.clusters / self.hours * float(self.weight @ self._share(level))

    def log_variance(self, level: float) -> float:
        """Return the variance of the logarithm of that rate, as if it were log-normal."""
        share = self._share(level)
        return float(np.log((self.weight @ share**2) / (self.weight @ share) ** 2)) + 1.0 / self.clusters

    def level(self, rate: float) -> float:
        """Return the level that peaks exceed at a rate per hour, at least ``start``."""
        if self.rate(self.start) <= rate:
            return self.start
        low, high = self.start, self.start + float(np.max(self.width))
        while self.rate(high) > rate:
            low, high = high, self.start + 2.0 * (high - self.start)
        # SciPy's root finders take a tenth of a second to load.
        while high - low > PRECISION * max(abs(low), abs(high)):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.rate(middle) > rate else (low, middle)
        return high

    def _share(self, level: float) -> Array:
        """Return the share of the peaks above a level by each law, shape (m,)."""
        reach = np.maximum(0.0, 1.0 + self.shape * max(0.0, level - self.start) / self.width)
        return np.asarray(reach ** (-1.0 / self.shape))


def fit_tail(times: Sequence[Array], scores: Sequence[Array], seconds: float, rate: float) -> Tail:
    """Return what the tail of a score may be: by the likelihood of its peaks, and a normal prior of the shape.

    Parameters
    ----------
    times, scores : sequence of ndarray, shape (N,)
        Of each recording.
    seconds : float
        In all.
    rate : float
        Per hour, that a level is looked for at.
    """
    wanted = max(
        float(np.clip(CLUSTER_SHARE * seconds, MIN_CLUSTERS, MAX_CLUSTERS)),
        CLUSTERS_OVER_RATE * rate * seconds / HOUR,
    )
    # One after the other, far enough apart for no cluster to be of two.
    starts = np.cumsum([0.0, *(float(np.ptp(time)) + 2.0 * CLUSTER_SECONDS for time in times[:-1])])
    time = np.concatenate([own - own[0] + start for own, start in zip(times, starts, strict=True)])
    score = np.concatenate(scores)
    # The number of clusters grows as the level falls, until they meet.
    start, top = float(np.max(score)), np.zeros(0)
    for level in np.quantile(score, 1.0 - np.geomspace(1.0 / len(score), 0.3, LEVELS)):
        found = peaks(time, score, float(level))
        if len(found) > len(top):
            start, top = float(level), found
        if len(found) >= wanted:
            break
    return tail_of(top, start, seconds)


def tail_of(tops: Array, start: float, seconds: float, *, censored: int = 0, prior: float = PRIOR) -> Tail:
    """Return what the tail above a start may be, of one value of each cluster.

    Parameters
    ----------
    tops : ndarray, shape (N,)
        Those not above the start do not matter.
    start, seconds : float
    censored : int
        Of so many of the largest it is used only that they are the largest: they may be no part of the law.
    prior : float
        Standard deviation of the shape before anything is seen.
    """
    above = np.sort(tops[tops > start]) - start
    return Tail(start, *_laws(above, censored, prior), len(above), seconds / HOUR)


def _laws(above: Array, censored: int, prior: float) -> tuple[Array, Array, Array]:
    """Return widths, shapes and probabilities of the laws that peaks so far above the start, ascending, may have."""
    count = len(above) - censored
    if count <= 0:
        return np.ones(1), SHAPES[-1:], np.ones(1)
    # The largest that is seen stands for those that are not.
    seen = np.minimum(above, above[count - 1])
    shape, away = (grid.ravel() for grid in np.meshgrid(SHAPES, WIDTHS, indexing="ij"))
    width = float(np.sum(seen)) / count * (1.0 - shape) * np.exp(away / np.sqrt(count + 1.0))
    reach = 1.0 + shape[:, None] * seen / width[:, None]
    # A law that ends below a peak is not possible.
    can = np.all(reach > 0.0, axis=1)
    width, shape, reach = width[can], shape[can], np.log(reach[can])
    # Of those not seen the likelihood is the share beyond.
    log = -count * np.log(width) - np.sum(reach[:, :count], axis=1) - np.sum(reach, axis=1) / shape
    log -= 0.5 * (shape / prior) ** 2
    weight = np.exp(log - np.max(log))
    kept = weight > MIN_WEIGHT * np.sum(weight)
    return width[kept], shape[kept], weight[kept] / np.sum(weight[kept])


def peaks(time: Array, score: Array, level: float) -> Array:
    """Return the largest score of each cluster above a level."""
    return np.array([float(np.max(score[first : last + 1])) for first, last in clusters(time, score, level)])


def clusters(time: Array, score: Array, level: float) -> list[tuple[int, int]]:
    """Return first and last sample of each cluster above a level, which `CLUSTER_SECONDS` parts from the next."""
    above: NDArray[np.intp] = np.flatnonzero(score > level)
    if len(above) == 0:
        return []
    cuts = np.flatnonzero(np.diff(time[above]) > CLUSTER_SECONDS)
    firsts, lasts = above[np.r_[0, cuts + 1]], above[np.r_[cuts, len(above) - 1]]
    return [(int(first), int(last)) for first, last in zip(firsts, lasts, strict=True)]
