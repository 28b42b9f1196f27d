"""Does the effort's clock run as fast as the position's? Where it does not, the delay between them grows over a run."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.estimation.information import orthonormal, weighted
from scara_ident.estimation.joint_rows import JointRows
from scara_ident.estimation.observations import Observations
from scara_ident.threads import side_by_side

# A drift is said where it is this many standard deviations from none, ...
CERTAIN = 5.0
# ... and explains this share of what the model leaves: less moves no parameter by more than its uncertainty.
SHARE = 2e-3


def clock_drift(value: Array, observations: Observations) -> str | None:
    """Say how fast effort drifts against position, if it does.

    To first order a torque u that lags by d + r t differs from u by -(d + r t) du/dt. The rate r is the same in all
    recordings, the delay d of each its own. The standard deviation is of the scores of blocks of time, which may be
    correlated within (White 1980, "A heteroskedasticity-consistent covariance matrix estimator").

    Parameters
    ----------
    value : ndarray, shape (p,)
    observations : Observations
        With the columns at every sample.

    Returns
    -------
    str or None
        None where the clocks agree.
    """
    if any(rows.table.shape[1] != _kept(observations, j) for j, rows in enumerate(observations.joints)):
        # Blocks without rows, or with an event, were taken out: which sample is whose is no more known.
        return None
    noise = np.array([rows.rms(value) for rows in observations.joints])
    weight = np.where(noise > 0.0, 1.0 / np.where(noise > 0.0, noise, 1.0), 0.0)
    # Made once, and not in two threads.
    _ = observations.late(value)

    joints = side_by_side(lambda j: _sums(value, observations, j, float(weight[j])), range(len(weight)))
    # What parameters and one delay for each recording explain is none of the drift's: the model's columns are projected out
    # by the triangular factor that is known, the delays by their few products.
    root = orthonormal(weighted(observations.by_joint, weight).regressor_factor)
    shared, told = (
        np.sum([root[joint.rows.columns].T @ getattr(joint, name) for joint in joints], axis=0)
        for name in ("of_lags", "of_others")
    )
    products = np.diag(np.sum([joint.squares for joint in joints], axis=0)) - shared.T @ shared
    late = np.linalg.pinv(products, rcond=1e-9, hermitian=True) @ (
        np.sum([joint.scores for joint in joints], axis=0) - shared.T @ told
    )
    known = root @ (told - shared @ late)
    score, information, square = np.zeros(observations.blocks), np.zeros(observations.blocks), 0.0
    for joint, factor in zip(joints, weight, strict=True):
        delayed = np.repeat(late, np.diff(joint.bounds), axis=0).T * joint.lag
        growing, left = joint.others - factor * (known[joint.rows.columns].T @ joint.rows.table[:-1]) - delayed
        block = np.repeat(np.arange(observations.blocks), np.diff(joint.rows.starts))
        score += np.bincount(block, growing * left, observations.blocks)
        information += np.bincount(block, growing**2, observations.blocks)
        square += float(left @ left)
    if not np.sum(information) * square > 0.0:
        return None
    rate = float(np.sum(score) / np.sum(information))
    std = float(np.sqrt(np.sum((score - information * rate) ** 2)) / np.sum(information))
    if abs(rate) < CERTAIN * std or rate * np.sum(score) < SHARE * square:
        return None
    longest = max(item.time[-1] - item.time[0] for item in observations.data.sources)
    return (
        f"effort drifts against position, by {100 * abs(rate):.2g} % of the time, {1e3 * abs(rate) * longest:.2g} ms over a run "
        f"of {longest:.3g} s: they have two clocks, where nothing else changes over a run, as friction that warms up does; "
        "parameters are off; record both by one clock"
    )


def _kept(observations: Observations, joint: int) -> int:
    return sum(len(part.kept[joint]) for part in observations.data.stretches if part.usable)


@dataclass(frozen=True, eq=False)
class _Sums:
    """Of one joint, weighted: its rows, and products of what each of r recordings changes by when it is late.

    Attributes
    ----------
    lag : ndarray, shape (N,)
        What the torque changes by when its own recording is late.
    others : ndarray, shape (2, N)
        What it changes by when all grow later, and what parameters leave of it.
    bounds : ndarray of int, shape (r + 1,)
        Where the rows of each recording begin.
    of_lags, of_others : ndarray, shapes (k, r) and (k, 2)
        Their products with the columns.
    squares, scores : ndarray, shapes (r,) and (r, 2)
        Those of the lags, and with the others.
    """

    rows: JointRows
    lag: Array
    others: Array
    bounds: NDArray[np.intp]
    of_lags: Array
    of_others: Array
    squares: Array
    scores: Array


def _sums(value: Array, observations: Observations, joint: int, weight: float) -> _Sums:
    rows, columns = observations.joints[joint], observations.joints[joint].table[:-1]
    times, ends = list[Array](), [0]
    for item in observations.data.recordings:
        start = item.stretches[0].stretch.time[0]
        times += [part.stretch.time[part.kept[joint]] - start for part in item.stretches if part.usable]
        ends.append(sum(map(len, times)))
    # A filter's memory is short against the time in which a delay grows, so that it may be multiplied after it.
    lag = weight * observations.late(value)[joint]
    growing = lag * np.concatenate(times)
    others = np.array([growing, weight * (rows.table[-1] - value[rows.columns] @ columns)])
    runs = [slice(a, b) for a, b in pairwise(ends)]
    return _Sums(
        rows,
        lag,
        others,
        np.array(ends, dtype=np.intp),
        weight * np.stack([columns[:, run] @ lag[run] for run in runs], axis=1),
        weight * (columns @ others.T),
        np.array([lag[run] @ lag[run] for run in runs]),
        np.array([others[:, run] @ lag[run] for run in runs]),
    )
