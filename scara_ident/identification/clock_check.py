"""Does the effort's clock run as fast as the position's? Where it does not, the delay between them grows over a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.estimation.information import UNDETERMINED, orthonormal, weighted
from scara_ident.estimation.joint_rows import JointRows
from scara_ident.estimation.observations import Observations
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms import Friction, Offset
from scara_ident.threads import side_by_side

# A drift is said where chance makes one as large as rarely as it makes 5 standard deviations of many blocks of time, ...
DRIFT_LEVEL = 5.7e-7
# ... and explains this share of what the model leaves: less moves no parameter by more than its uncertainty.
SHARE = 2e-3
# Powers of time by which friction and offset may change over a recording.
CHANGES = (1, 2)


def clock_drift(value: Array, observations: Observations) -> str | None:
    """Say how fast effort drifts against position, if it does.

    To first order a torque u that lags by d + r t differs from u by -(d + r t) du/dt. The rate r is the same in all
    recordings, the delay d of each its own. The standard deviation is of the scores of blocks of time, which may be
    correlated within, each without its own part in the fit (the jackknife of MacKinnon and White 1985), and few blocks
    are judged by Student's t with the number that counts (Carter, Schnepel and Steigerwald 2017, "Asymptotic behavior
    of a t-test robust to cluster heterogeneity"). Friction and offset that change over a recording look like a lag that
    grows where the motion has few frequencies: the drift has to be there beside such a change of every joint too.

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

    def sums(changes: Sequence[int]) -> list[_Sums]:
        return side_by_side(lambda j: _sums(value, observations, j, float(weight[j]), changes), range(len(weight)))

    factor = weighted(observations.by_joint, weight).regressor_factor
    rate = _rate(sums(()), factor, weight, observations.blocks)
    if rate is None:
        return None
    changed = sums(CHANGES)
    parts = [joint.rows.information(len(value)) for joint in changed]
    rate = _rate(changed, weighted(parts, weight).regressor_factor, weight, observations.blocks)
    if rate is None:
        return None
    longest = max(item.time[-1] - item.time[0] for item in observations.data.sources)
    return (
        f"effort drifts against position, by {100 * abs(rate):.2g} % of the time, {1e3 * abs(rate) * longest:.2g} ms over a run "
        f"of {longest:.3g} s: they have two clocks, unless something else changes during a run, such as friction that "
        f"warms up; the parameters are wrong; record both with one clock"
    )


def _rate(joints: Sequence[_Sums], factor: Array, weight: Array, blocks: int) -> float | None:
    """Return the rate of a drift that is more than chance; ``factor`` is the triangular one of all weighted rows."""
    from scipy.special import stdtr

    # What parameters and one delay for each recording explain is none of the drift's: the model's columns are projected out
    # by the triangular factor that is known, the delays by their few products.
    root = orthonormal(factor)
    shared, of_others = (
        np.sum([root[joint.rows.columns].T @ getattr(joint, name) for joint in joints], axis=0)
        for name in ("of_lags", "of_others")
    )
    products = np.diag(np.sum([joint.squares for joint in joints], axis=0)) - shared.T @ shared
    late = np.linalg.pinv(products, rcond=1e-9, hermitian=True) @ (
        np.sum([joint.scores for joint in joints], axis=0) - shared.T @ of_others
    )
    known = root @ (of_others - shared @ late)
    score, information, square = np.zeros(blocks), np.zeros(blocks), 0.0
    for joint, size in zip(joints, weight, strict=True):
        delayed = np.repeat(late, np.diff(joint.bounds), axis=0).T * joint.lag
        growing, left = joint.others - size * (known[joint.rows.columns].T @ joint.rows.table[:-1]) - delayed
        block = np.repeat(np.arange(blocks), np.diff(joint.rows.starts))
        score += np.bincount(block, growing * left, blocks)
        information += np.bincount(block, growing**2, blocks)
        square += float(left @ left)
    total = float(np.sum(information))
    if not total * square > 0.0:
        return None
    rate, share = float(np.sum(score)) / total, information / total
    counted = 1.0 / float(np.sum(share**2))
    # One block that tells it all is known by nothing.
    own = (score - information * rate) / np.maximum(1.0 - share, np.finfo(float).eps)
    std = float(np.sqrt(np.sum(own**2))) / total
    if counted <= 2.0 or rate * np.sum(score) < SHARE * square:
        return None
    return rate if 2.0 * stdtr(counted - 1.0, -abs(rate) / std) < DRIFT_LEVEL else None


def _kept(observations: Observations, joint: int) -> int:
    return sum(len(part.kept[joint]) for part in observations.data.stretches if part.usable)


@dataclass(frozen=True, eq=False)
class _Sums:
    """Of one joint, weighted: its rows, and products of what each of r recordings changes by when it is late.

    Attributes
    ----------
    rows : JointRows
        Without weight, as `observe` made them or without what changes over each recording.
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


def _sums(value: Array, observations: Observations, joint: int, weight: float, changes: Sequence[int]) -> _Sums:
    """Return the sums of a joint beside friction and offset that change with these powers of time in each recording."""
    rows = observations.joints[joint]
    times, ends = list[Array](), [0]
    for item in observations.data.recordings:
        start = item.stretches[0].stretch.time[0]
        times += [part.stretch.time[part.kept[joint]] - start for part in item.stretches if part.usable]
        ends.append(sum(map(len, times)))
    runs = [slice(a, b) for a, b in pairwise(ends)]
    time = np.concatenate(times)
    # A filter's memory is short against the time in which a delay grows, so that it may be multiplied after it.
    lag = observations.late(value)[joint]
    signals = np.array([lag, lag * time, rows.table[-1] - value[rows.columns] @ rows.table[:-1]])
    if changes:
        own = _changing(observations.model, rows)
        table = rows.table.copy()
        for run in runs:
            basis = np.concatenate([own[:, run] * time[run] ** power for power in changes])
            for each in (table, signals):
                each[:, run] = _without(each[:, run], basis)
        rows = replace(rows, table=table)
    lag, others = weight * signals[0], weight * signals[1:]
    columns = rows.table[:-1]
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


def _changing(model: TorqueModel, rows: JointRows) -> Array:
    """Return the columns of a joint's friction and offset, shape (m, N)."""
    places = [model.place(term) for term in model.terms if isinstance(term, Friction | Offset)]
    its = [any(place.start <= column < place.stop for place in places) for column in rows.columns]
    return rows.table[:-1][its]


def _without(signals: Array, basis: Array) -> Array:
    """Return signals, shape (k, N), without what rows of a basis, shape (m, N), explain of them."""
    size = np.linalg.norm(basis, axis=1)
    inside = basis[size > 0.0] / size[size > 0.0, None]
    if not inside.size:
        return signals
    turned, singular, _ = np.linalg.svd(inside.T, full_matrices=False)
    kept = turned[:, singular > UNDETERMINED * singular[0]]
    return np.asarray(signals - (signals @ kept) @ kept.T)
