"""How much an unseen run differs from a model, where runs were found to differ."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.run_variation import RunVariation, directions_of


def of_another_run(variation: RunVariation, observations: Observations, value: Array) -> Array:
    """Return the rms torque by which further runs are expected to lie off the mean of those that were seen.

    Each kind of difference is a draw of its standard deviation, see `scara_ident.estimation.run_variation`.

    Parameters
    ----------
    variation : RunVariation
        Of the runs that were seen.
    observations : Observations
        Of the same model, on the further ones.
    value : ndarray, shape (p,)

    Returns
    -------
    ndarray, shape (n,)
        N m (N); zero where runs do not differ, or no samples are kept.
    """
    found = np.zeros(len(variation.joints))
    for joint, std, directions in _differing(variation, observations, value):
        found[joint] = np.sqrt(np.sum(std[:, None] ** 2 * directions**2) / observations.joints[joint].samples)
    return found


def variance_of_another_run(
    variation: RunVariation, observations: Observations, value: Array, signals: Sequence[Array]
) -> float:
    """Return the variance of the sum of products with signals that is expected of the torque by which further runs lie off.

    Parameters
    ----------
    value : ndarray, shape (p,)
        As of `of_another_run`.
    signals : sequence of ndarray, shape (N,)
        On the rows of each joint.

    Returns
    -------
    float
        Each run being one draw of each kind of difference.
    """
    total, runs = 0.0, len(observations.data.recordings)
    for joint, std, directions in _differing(variation, observations, value):
        run = np.repeat(observations.owner, np.diff(observations.joints[joint].starts))
        for size, direction in zip(std, directions, strict=True):
            total += float(np.sum((size * np.bincount(run, direction * signals[joint], runs)) ** 2))
    return total


def left_beside_own(
    variation: RunVariation, observations: Observations, value: Array, shares: Array | None = None
) -> tuple[Array, ...]:
    """Return what a model leaves of further runs beside what each of them may differ by, (N,) on the rows of each joint.

    Each run has as much of every kind that runs were found to differ by as leaves least on a joint. What is left stands for as many
    rows as there are, and not for those that these amounts take up.

    Parameters
    ----------
    variation, observations, value
        As of `of_another_run`.
    shares : ndarray, shape (blocks,), optional
        How much each block counts; all by default.
    """
    lengths = [np.diff(rows.starts) for rows in observations.joints]
    sizes = [np.ones(int(each.sum())) if shares is None else np.repeat(np.sqrt(shares), each) for each in lengths]
    left = [size * rows.left(value) for size, rows in zip(sizes, observations.joints, strict=True)]
    for joint, std, directions in _differing(variation, observations, value):
        run = np.repeat(observations.owner, lengths[joint])
        differing = (sizes[joint] * directions[std > 0.0]).T
        for one in np.unique(run[sizes[joint] > 0.0]):
            place = (run == one) & (sizes[joint] > 0.0)
            columns, torque = differing[place], left[joint][place]
            scale = np.linalg.norm(columns, axis=0)
            columns = columns / np.where(scale > 0.0, scale, 1.0)
            amount, _, rank, _ = np.linalg.lstsq(columns, torque)
            free = len(torque) - rank
            if free > 0:
                left[joint][place] = np.sqrt(len(torque) / free) * (torque - columns @ amount)
    return tuple(left)


def _differing(variation: RunVariation, observations: Observations, value: Array) -> Iterator[tuple[int, Array, Array]]:
    """Give joints on which runs differ, by which standard deviation, and what one unit of each does on their rows."""
    if not observations.raw:
        return
    for joint, (item, rows) in enumerate(zip(variation.joints, observations.joints, strict=True)):
        if item is not None and rows.table.shape[1] and rows.sizes is None:
            yield joint, item.std, directions_of(observations, joint, rows, value)
