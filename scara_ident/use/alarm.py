"""Alarm thresholds of an external torque at a stated rate of false alarms.

The size of the residual is explained by features of the motion, joint by joint; in units of that the largest over the joints is
watched. The alarm is at the level that its peaks exceed as often as is stated (`tail`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError
from scara_ident.estimation.tail import CLUSTER_SECONDS, CLUSTERS_OVER_RATE, MIN_CLUSTERS, Tail, fit_tail
from scara_ident.use.external_torque import Observed

# Groups of recordings left out to see how sure the rate is.
FOLDS = 5
# Share of its samples that brings every joint's residual to one scale.
COMMON_QUANTILE = 0.995
# Largest spread of the rate that is allowed for: more is a guess.
MAX_SPREAD = 1.5
# Least share of the mean size of a joint's peaks that their size is taken for in any state.
MIN_SCALE = 0.2


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
        Of the tail, mean of those possible; 0 is exponential, one below 0 ends.
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
        If they are too short, or the rate is higher than peaks come.
    """
    seconds = np.array([np.sum(step_of(run)[run.settled]) for run in runs])
    if np.sum(seconds) < MIN_CLUSTERS:
        raise RecordingError(
            f"{runs[0].name}: {np.sum(seconds):.3g} s without contact in all; thresholds need {MIN_CLUSTERS} s or more"
        )
    scale, floor = residual_scale(runs)
    # Joints are brought to one scale: none makes most alarms.
    each = [np.abs(run.torque[:, run.settled]) / sized(scale, floor, run.features[:, :, run.settled]) for run in runs]
    common = np.quantile(np.concatenate(each, axis=1), COMMON_QUANTILE, axis=1)
    scores = [np.max(z / common[:, None], axis=0) for z in each]
    times = [run.time[run.settled] for run in runs]
    tail = fit_tail(times, scores, float(np.sum(seconds)), rate)
    most = tail.clusters / tail.hours / CLUSTERS_OVER_RATE
    if rate > most:
        raise RecordingError(
            f"{runs[0].name}: {rate:g} false alarms per hour are more than the peaks of the residual support; give {most:.3g} or fewer"
        )
    level, spread = stated_level(tail, times, scores, seconds, rate)
    factor = level * common
    return Alarm(factor[:, None] * scale, factor * floor, rate, tail.hours, tail.clusters, tail.mean_shape, spread)


def stated_level(
    tail: Tail, times: Sequence[Array], scores: Sequence[Array], seconds: Array, rate: float
) -> tuple[float, float]:
    """Return the level that a score exceeds at a rate per hour, and the spread of that rate as in `Alarm`.

    Parameters
    ----------
    tail : Tail
        Of all the recordings.
    times, scores : sequence of ndarray, shape (N,)
        Of each recording.
    seconds : ndarray, shape (m,)
        How long each is.
    rate : float
    """
    level, folds, logs = tail.level(rate), min(FOLDS, len(times)), []
    if folds < 3:
        return level, np.nan
    for fold in range(folds):
        kept = [k for k in range(len(times)) if k % folds != fold]
        part = fit_tail([times[k] for k in kept], [scores[k] for k in kept], float(np.sum(seconds[kept])), rate)
        logs.append(np.log(max(part.rate(level), 1e-6)))
    # Jackknife.
    spread = float(np.sqrt((folds - 1) * np.var(logs)))
    # The mean of a rate that is known to so much in its logarithm is larger than its median: of a log-normal law by this.
    # What peaks make that do not depend on their recording is in the predictive rate already.
    sure = 0.5 * max(0.0, min(spread, MAX_SPREAD) ** 2 - tail.log_variance(level))
    return tail.level(rate * float(np.exp(-sure))), spread


def step_of(run: Observed) -> Array:
    """Return how long each sample stands, s, shape (N,); those after a gap no longer than the others."""
    steps = np.diff(run.time, prepend=run.time[0])
    return np.minimum(steps, 5.0 * float(np.median(steps)))


def sized(scale: Array, floor: Array, features: Array) -> Array:
    """Return the usual size of the residual, shape (n, N)."""
    return np.asarray(np.maximum(np.einsum("jk,jkn->jn", scale, features), floor[:, None]))


def residual_scale(runs: Sequence[Observed]) -> tuple[Array, Array]:
    """Return what the peaks of the residual are made of, shape (n, k), and the least of their size, shape (n,).

    The largest absolute value in each `CLUSTER_SECONDS` is fitted by the features' means with coefficients that are not negative.
    Peaks and not the mean, since a joint at rest has nearly the same residual all the time, and one that moves has not.
    """
    largest, _, features = in_windows(runs)
    return made_of(largest, features), MIN_SCALE * np.maximum(np.mean(largest, axis=1), 1e-12)


def made_of(size: Array, features: Array) -> Array:
    """Return the coefficients, none negative, of features (n, k, m) that make each joint's sizes (n, m) best, shape (n, k)."""
    from scipy.optimize import nnls

    found = np.zeros(features.shape[:2])
    for joint, (rows, own) in enumerate(zip(features, size, strict=True)):
        unit = np.maximum(np.mean(rows, axis=1), 1e-12)
        found[joint] = nnls((rows / unit[:, None]).T, own)[0] / unit
    return found


def in_windows(runs: Sequence[Observed]) -> tuple[Array, Array, Array]:
    """Return of each of m windows the residual's largest size and mean square (n, m), and the mean of the features (n, k, m)."""
    parts = []
    for run in runs:
        places = np.flatnonzero(run.settled)
        if len(places) == 0:
            continue
        torque = run.torque[:, places]
        window = np.floor(run.time[places] / CLUSTER_SECONDS)
        starts = np.r_[0, np.flatnonzero(np.diff(window)) + 1]
        count = np.diff(np.r_[starts, len(places)])
        largest = np.maximum.reduceat(np.abs(torque), starts, axis=1)
        square = np.add.reduceat(torque**2, starts, axis=1) / count
        parts.append((largest, square, np.add.reduceat(run.features[:, :, places], starts, axis=2) / count))
    largest, square, features = (np.concatenate(each, axis=-1) for each in zip(*parts, strict=True))
    return largest, square, features
