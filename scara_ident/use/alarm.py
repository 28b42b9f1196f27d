"""When an external torque is no longer what the model's errors make: thresholds with a stated rate of false alarms.

The size of the residual is explained by features of the motion, joint by joint; in units of that the largest over the joints is
watched. What exceeds a high level comes in clusters, whose peaks follow a generalised Pareto law (peaks over threshold:
Davison and Smith, "Models for exceedances over high thresholds", JRSS B 52, 1990; Coles, *An Introduction to Statistical
Modeling of Extreme Values*, 2001, chapters 4 and 5). The alarm is at the level that peaks exceed as often as is stated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError
from scara_ident.use.external_torque import Observed

# Exceedances closer than this, s, are one cluster, and one alarm.
TOGETHER = 0.5
# Clusters that the tail is fitted to, if there are as many: a share of the seconds recorded, within bounds.
CLUSTER_SHARE, LEAST_CLUSTERS, MOST_CLUSTERS = 0.1, 20, 400
# Levels that are tried for that, and groups of recordings left out to see how sure the rate is.
LEVELS, FOLDS = 30, 5
# Share of its samples that brings every joint's residual to one scale.
COMMON = 0.995
# A tail is not taken for one that ends, nor for one without variance.
LEAST_SHAPE, MOST_SHAPE = 0.0, 0.4
# Largest spread of the rate that is allowed for: more is a guess.
MOST_SPREAD = 1.5
# Least share of the mean size of a joint's peaks that their size is taken for in any state.
LEAST_SCALE = 0.2
HOUR = 3600.0


@dataclass(frozen=True, eq=False)
class Alarm:
    """Thresholds of the external torque.

    Attributes
    ----------
    scale : ndarray, shape (n, k)
        Threshold of each joint per feature, recorded side: the threshold is the sum over the features.
    floor : ndarray, shape (n,)
        Least threshold.
    rate : float
        Stated false alarms per hour.
    hours : float
        Of motion without contact that it rests on.
    clusters : int
        Peaks that the tail was fitted to.
    shape : float
        Of the tail; 0 is exponential.
    spread : float
        Standard deviation of the logarithm of that rate, by leaving recordings out; the thresholds allow for it.
    """

    scale: Array
    floor: Array
    rate: float
    hours: float
    clusters: int
    shape: float
    spread: float

    def threshold(self, features: Array) -> Array:
        """Return the threshold of each joint, recorded side: shape (n,) of features (n, k), (n, N) of (n, k, N)."""
        found = np.einsum("jk,jk...->j...", self.scale, features)
        return np.asarray(np.maximum(found, self.floor.reshape(-1, *(1,) * (found.ndim - 1))))


def calibrate(runs: Sequence[Observed], rate: float) -> Alarm:
    """Return thresholds that motion without contact exceeds at a rate.

    Parameters
    ----------
    runs : sequence of Observed
        Recordings without contact; best others than those that the model was identified from.
    rate : float
        False alarms per hour of such motion.

    Raises
    ------
    RecordingError
        If they are too short.
    """
    seconds = np.array([np.sum(step_of(run)[run.settled]) for run in runs])
    if np.sum(seconds) < LEAST_CLUSTERS:
        raise RecordingError(
            f"{runs[0].name}: {np.sum(seconds):.3g} s without contact in all; thresholds need {LEAST_CLUSTERS} s or more"
        )
    scale, floor = residual_scale(runs)
    # Joints are brought to one scale: none makes most alarms.
    each = [np.abs(run.torque[:, run.settled]) / sized(scale, floor, run.features[:, :, run.settled]) for run in runs]
    common = np.quantile(np.concatenate(each, axis=1), COMMON, axis=1)
    scores = [np.max(z / common[:, None], axis=0) for z in each]
    times = [run.time[run.settled] for run in runs]
    tail = fit_tail(times, scores, float(np.sum(seconds)))
    level = tail.level(rate)
    logs = []
    folds = min(FOLDS, len(runs))
    for fold in range(folds if len(runs) > 2 else 0):
        kept = [k for k in range(len(runs)) if k % folds != fold]
        part = fit_tail([times[k] for k in kept], [scores[k] for k in kept], float(np.sum(seconds[kept])))
        logs.append(np.log(max(part.rate(level), 1e-6)))
    # Jackknife.
    spread = float(np.sqrt((folds - 1) * np.var(logs))) if logs else np.nan
    # The mean of a rate that is known to so much in its logarithm is larger than its median: of a log-normal law by this.
    sure = 0.5 * min(spread, MOST_SPREAD) ** 2 if logs else 0.0
    factor = tail.level(rate * float(np.exp(-sure))) * common
    hours = float(np.sum(seconds)) / HOUR
    return Alarm(factor[:, None] * scale, factor * floor, rate, hours, tail.clusters, tail.shape, spread)


def step_of(run: Observed) -> Array:
    """Return how long each sample stands, s, shape (N,); those after a gap no longer than the others."""
    steps = np.diff(run.time, prepend=run.time[0])
    return np.minimum(steps, 5.0 * float(np.median(steps)))


def sized(scale: Array, floor: Array, features: Array) -> Array:
    """Return the usual size of the residual, shape (n, N)."""
    return np.asarray(np.maximum(np.einsum("jk,jkn->jn", scale, features), floor[:, None]))


def residual_scale(runs: Sequence[Observed]) -> tuple[Array, Array]:
    """Return what the peaks of the residual are made of, shape (n, k), and the least of their size, shape (n,).

    The largest absolute value in each `TOGETHER` is fitted by the features' means with coefficients that are not negative.
    Peaks and not the mean, since a joint at rest has nearly the same residual all the time, and one that moves has not.
    """
    parts = [_in_windows(run) for run in runs]
    size = np.concatenate([part[0] for part in parts], axis=1)
    features = np.concatenate([part[1] for part in parts], axis=2)
    scale = np.zeros(features.shape[:2])
    for joint, (rows, own) in enumerate(zip(features, size, strict=True)):
        unit = np.maximum(np.mean(rows, axis=1), 1e-12)
        scale[joint] = nnls((rows / unit[:, None]).T, own)[0] / unit
    return scale, LEAST_SCALE * np.maximum(np.mean(size, axis=1), 1e-12)


def _in_windows(run: Observed) -> tuple[Array, Array]:
    """Return the largest size of the residual (n, m) and the mean of the features (n, k, m) in each of m windows."""
    places = np.flatnonzero(run.settled)
    if len(places) == 0:
        return np.zeros((len(run.torque), 0)), np.zeros((*run.features.shape[:2], 0))
    window = np.floor(run.time[places] / TOGETHER)
    starts = np.r_[0, np.flatnonzero(np.diff(window)) + 1]
    count = np.diff(np.r_[starts, len(places)])
    size = np.maximum.reduceat(np.abs(run.torque[:, places]), starts, axis=1)
    return size, np.add.reduceat(run.features[:, :, places], starts, axis=2) / count


@dataclass(frozen=True)
class Tail:
    """Generalised Pareto law of the peaks of clusters above a level ``start``.

    Attributes
    ----------
    start, width, shape : float
    clusters : int
    hours : float
    """

    start: float
    width: float
    shape: float
    clusters: int
    hours: float

    def level(self, rate: float) -> float:
        """Return the level that peaks exceed at a rate per hour."""
        log = float(np.log(self.clusters / self.hours / rate))
        grown = log if self.shape == 0.0 else float(np.expm1(self.shape * log)) / self.shape
        return self.start + self.width * grown

    def rate(self, level: float) -> float:
        """Return how often an hour peaks exceed a level."""
        above = (level - self.start) / self.width
        log = above if self.shape == 0.0 else float(np.log(max(1e-12, 1.0 + self.shape * above))) / self.shape
        return self.clusters / self.hours * float(np.exp(-log))


def fit_tail(times: Sequence[Array], scores: Sequence[Array], seconds: float) -> Tail:
    """Fit the tail of a score by probability-weighted moments (Hosking and Wallis, Technometrics 29, 1987).

    Parameters
    ----------
    times, scores : sequence of ndarray, shape (N,)
        Of each recording.
    seconds : float
        In all.
    """
    wanted = int(np.clip(CLUSTER_SHARE * seconds, LEAST_CLUSTERS, MOST_CLUSTERS))
    # One after the other, far enough apart for no cluster to be of two.
    starts = np.cumsum([0.0, *(float(np.ptp(time)) + 2.0 * TOGETHER for time in times[:-1])])
    time = np.concatenate([own - own[0] + start for own, start in zip(times, starts, strict=True)])
    score = np.concatenate(scores)
    # The number of clusters grows as the level falls, until they meet.
    best = Tail(float(np.max(score)), 1.0, 0.0, 0, seconds / HOUR)
    top = np.zeros(1)
    for level in np.quantile(score, 1.0 - np.geomspace(1.0 / len(score), 0.3, LEVELS)):
        found = peaks(time, score, float(level))
        if len(found) > best.clusters:
            best, top = Tail(float(level), 1.0, 0.0, len(found), seconds / HOUR), np.sort(found) - level
        if len(found) >= wanted:
            break
    count = len(top)
    share = (np.arange(1, count + 1) - 0.35) / count
    mean, weighted = float(np.mean(top)), float(np.mean((1.0 - share) * top))
    shape = 2.0 - mean / (mean - 2.0 * weighted) if mean > 2.0 * weighted else LEAST_SHAPE
    shape = float(np.clip(shape, LEAST_SHAPE, MOST_SHAPE))
    # The mean is kept, whatever the shape was bounded to.
    return Tail(best.start, max(mean * (1.0 - shape), 1e-9 * best.start), shape, best.clusters, seconds / HOUR)


def peaks(time: Array, score: Array, level: float) -> Array:
    """Return the largest score of each cluster above a level."""
    return np.array([float(np.max(score[first : last + 1])) for first, last in clusters(time, score, level)])


def clusters(time: Array, score: Array, level: float) -> list[tuple[int, int]]:
    """Return first and last sample of each cluster above a level, which `TOGETHER` parts from the next."""
    above: NDArray[np.intp] = np.flatnonzero(score > level)
    if len(above) == 0:
        return []
    cuts = np.flatnonzero(np.diff(time[above]) > TOGETHER)
    firsts, lasts = above[np.r_[0, cuts + 1]], above[np.r_[cuts, len(above) - 1]]
    return [(int(first), int(last)) for first, last in zip(firsts, lasts, strict=True)]
