"""How runs of one arm differ from date to date, by their kinds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.information import UNDETERMINED
from scara_ident.fleet.causes import RUN_KINDS
from scara_ident.fleet.history import History, beyond_noise, freedom_of, scatter

# What differs by itself, as sums of `RUN_KINDS`: the parts of friction in eight mixtures, from either alone to both together and
# against each other, and each other kind. Eight are enough for a correlation of 0.9 of any two sizes up to twice each other.
_ANGLES = np.pi * np.arange(8) / 8.0
_PAIRS = np.round([np.cos(_ANGLES), np.sin(_ANGLES)], 12)
PARTS = np.hstack([np.eye(len(RUN_KINDS), 2) @ _PAIRS, np.eye(len(RUN_KINDS))[:, 2:]])
# Rounds in which the variances settle, and the share of the largest within which they have.
ROUNDS, SETTLED_SHARE = 30, 1e-3


def run_scatter(histories: Sequence[History]) -> tuple[Array, float]:
    """Return how `RUN_KINDS` differ from date to date, joint by joint, and the degrees of freedom of that.

    Parameters
    ----------
    histories : sequence of History
        Of one robot and model.

    Returns
    -------
    root : ndarray, shape (5 n, 11 n)
        Of the covariance, ``root @ root.T``: a standard deviation for each of `PARTS`.
    """
    several = [item for item in histories if len(item.dates) > 1]
    joints, (kinds, parts) = histories[0].model.robot.n if histories else 0, PARTS.shape
    root = np.zeros((kinds * joints, parts * joints))
    if not several:
        return root, 0.0
    each = [item.run_sizes(np.eye(kinds)) for item in several]
    steps = np.concatenate([np.diff(sizes, axis=0) for sizes, _ in each])
    noise = np.concatenate([covers[1:] + covers[:-1] for _, covers in each])
    for j in range(joints):
        own = slice(kinds * j, kinds * (j + 1))
        variances = joint_scatter(steps[:, own], noise[:, own, own])
        root[own, parts * j : parts * (j + 1)] = PARTS * np.sqrt(variances)
    return root, freedom_of(len(steps))


def joint_scatter(steps: Array, noise: Array) -> Array:
    """Return the variance of each of `PARTS` on one date beyond noise, shape (11,), that explain differences between dates.

    They are fitted together, none below zero, in units of what differences scatter by with them, until both agree: estimates of
    restricted maximum likelihood (Anderson 1973), but for differences that lie far out, see `scatter`. What the noise hardly
    tells apart is so distinguished in sum: each for itself, the offset and the torque scale of an axis that lifts a weight slowly were none.

    Parameters
    ----------
    steps : ndarray, shape (N, 5)
    noise : ndarray, shape (N, 5, 5)
        NaN where a kind does nothing.
    """
    from scipy.optimize import nnls

    determined = np.isfinite(np.einsum("nii->ni", noise))
    kinds = np.any(determined, axis=0)
    kept = np.all(determined[:, kinds], axis=1)
    found = np.zeros(PARTS.shape[1])
    if not np.any(kinds) or not np.any(kept):
        return found
    steps, noise = steps[np.ix_(kept, kinds)], noise[np.ix_(kept, kinds, kinds)]
    # A mixture of which one part does nothing says nothing that the other alone does not.
    entering = np.flatnonzero(np.all(PARTS[~kinds] == 0.0, axis=0))
    parts = PARTS[np.ix_(kinds, entering)]
    size = np.sqrt(np.median(np.einsum("nii->ni", noise), axis=0))
    # Dates that tell little count as the others, by what they tell best and worst.
    trace = np.einsum("nii->n", noise / np.outer(size, size))
    base = np.median(trace) * np.mean(noise / trace[:, None, None], axis=0)
    one, other = np.triu_indices(len(size), 1)
    values = scatter(steps, np.einsum("nii->ni", noise))
    total = base + np.diag(values)
    variances = np.zeros(len(entering))
    for _ in range(ROUNDS):
        scale = np.sqrt(np.diag(total))
        values, vectors = np.linalg.eigh(total / np.outer(scale, scale))
        turn = (vectors / np.sqrt(np.maximum(values, UNDETERMINED * values[-1]))).T / scale
        # Variances of sums and differences tell covariances.
        turns = np.concatenate([turn, turn[one] + turn[other], turn[one] - turn[other]])
        beyond = beyond_noise(steps @ turns.T, np.einsum("ki,nij,kj->nk", turns, noise, turns))
        single, both, apart = np.split(beyond, [len(turn), len(turn) + len(one)])
        along = turn @ parts
        design = np.concatenate([along**2, np.sqrt(2.0) * along[one] * along[other]])
        before, aim = variances, np.concatenate([single, np.sqrt(2.0) * 0.25 * (both - apart)])
        reach = np.linalg.norm(design, axis=0)
        variances = nnls(design / reach, aim)[0] / reach
        total = base + 2.0 * (parts * variances) @ parts.T
        if np.all(np.abs(variances - before) <= SETTLED_SHARE * np.max(variances)):
            break
    found[entering] = variances
    return found
