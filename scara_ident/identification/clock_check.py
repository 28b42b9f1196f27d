"""Does the effort's clock run as fast as the position's? Where it does not, the delay between them grows over a run."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

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

    def of_joint(j: int, rows: JointRows) -> tuple[Array, Array, Array]:
        left = rows.table[-1] - value[rows.columns] @ rows.table[:-1]
        delays, growing = _delayed(value, observations, j)
        return rows.table[:-1] * weight[j], weight[j] * delays, weight[j] * np.vstack([growing, left])

    parts = side_by_side(of_joint, range(len(observations.joints)), observations.joints)
    models, lags, others = zip(*parts, strict=True)
    # What parameters and one delay for each recording explain is none of the drift's: the model's columns are projected out
    # by the triangular factor that is known, the delays by their few products.
    root = orthonormal(weighted(observations.by_joint, weight).regressor_factor)

    def in_model(signals: Sequence[Array]) -> Array:
        own = zip(observations.joints, models, signals, strict=True)
        return np.asarray(sum(root[rows.columns].T @ (model @ signal.T) for rows, model, signal in own))

    lag, right = np.hstack(lags), np.hstack(others)
    shared, told = in_model(lags), in_model(others)
    products, score = lag @ lag.T - shared.T @ shared, lag @ right.T - shared.T @ told
    late = np.linalg.pinv(products, rcond=1e-9, hermitian=True) @ score
    known = root @ (told - shared @ late)
    by_model = [known[rows.columns].T @ model for rows, model in zip(observations.joints, models, strict=True)]
    growing, left = right - np.hstack(by_model) - late.T @ lag
    block = np.concatenate(
        [np.repeat(np.arange(len(rows.starts) - 1), np.diff(rows.starts)) for rows in observations.joints]
    )
    score, information = np.bincount(block, growing * left), np.bincount(block, growing**2)
    if not np.sum(information) * np.sum(left**2) > 0.0:
        return None
    rate = float(np.sum(score) / np.sum(information))
    std = float(np.sqrt(np.sum((score - information * rate) ** 2)) / np.sum(information))
    if abs(rate) < CERTAIN * std or rate * np.sum(score) < SHARE * np.sum(left**2):
        return None
    longest = max(item.time[-1] - item.time[0] for item in observations.data.sources)
    return (
        f"effort drifts against position, by {100 * abs(rate):.2g} % of the time, {1e3 * abs(rate) * longest:.2g} ms over a run "
        f"of {longest:.3g} s: they have two clocks, and parameters are off; record both by one clock"
    )


def _kept(observations: Observations, joint: int) -> int:
    return sum(len(part.kept[joint]) for part in observations.data.stretches if part.usable)


def _delayed(value: Array, observations: Observations, joint: int) -> tuple[Array, Array]:
    """Return what a joint's torque changes by when each recording is late, (recordings, K), and where all grow later, (K,)."""
    rows, each, growing = observations.joints[joint], [], []
    for item, raws in zip(observations.data.recordings, observations.raw, strict=True):
        parts = []
        start = item.stretches[0].stretch.time[0]
        for part, raw in zip(item.stretches, raws, strict=True):
            if part.usable:
                slope = -np.gradient(value[rows.columns] @ raw[joint]) * part.rate
                parts.append(part.rows(joint, np.array([slope, slope * (part.stretch.time - start)])))
        late = np.concatenate(parts, axis=1) if parts else np.zeros((2, 0))
        each.append(late[0])
        growing.append(late[1])
    delays = np.zeros((len(each), rows.table.shape[1]))
    ends = np.cumsum([0, *map(len, each)])
    for k, late in enumerate(each):
        delays[k, ends[k] : ends[k + 1]] = late
    return delays, np.concatenate(growing)
