"""What a reading of the channels leaves on time that it was not fitted to, and on which joints its friction would push."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.estimation.least_squares import weighted_value, wls
from scara_ident.estimation.observations import Observations
from scara_ident.identification.channel_fault import MENDED
from scara_ident.model.terms.friction import Friction

# A better reading is better block by block at this level of significance.
SIGNIFICANCE_LEVEL = 0.001
# Rows per parameter of each joint below which a fit comes near interpolation, whatever the channels are.
ENOUGH_ROWS = 3.0
# Of readings that count the simpler is taken where the other leaves more than this share of what it leaves.
SIMPLER_SHARE = 0.8
# Joints that are left less than this share of their torque are explained.
POOR = 0.05
# Of a joint that is left more than this share of its torque less than half its power is explained, of which hardly an effect is the
# reason. There a wrong reading shows, while its mean over an arm's joints hides it: on most of them it leaves as much as the right one.
HARDLY = 0.5**0.5
# Pieces of each recording, one of which is held out in turns.
PIECES = 4
# Friction that feeds in this share of a joint's power, and this many standard deviations, points to a sign.
PUSHING = 0.02
PUSHING_STD = 4.0
# Residual that counts as none, as a share of the torque.
ROUNDING = 1e-12


def first_runs(observations: Observations) -> Observations:
    """Return the first run of every trajectory: what a channel is read as shows in each alike."""
    first = {label: place for place, label in reversed(list(enumerate(observations.data.labels)))}
    return observations.of(sorted(first.values()))


def few(observations: Observations) -> bool:
    """Tell whether a joint has too few rows for its fit to say anything."""
    return any(0 < rows.table.shape[1] < ENOUGH_ROWS * len(rows.columns) for rows in observations.joints)


def relative(value: Array, observations: Observations) -> Array:
    """Return what parameters leave of each joint's torque, as a share of it, shape (n,)."""
    tiny = np.finfo(float).tiny
    return np.array([part.rms(value) / max(part.torque_rms, tiny) for part in observations.by_joint])


def held_out(observations: Observations) -> tuple[Array, Array]:
    """Predict each piece of the recordings from the others.

    Returns
    -------
    left : ndarray, shape (blocks, n)
        Rms residual of each block as a share of the joint's torque; NaN where a joint has no rows.
    all_left : ndarray, shape (n,)
        The same over all blocks.
    """
    owner = observations.owner
    place = np.arange(len(owner)) - np.searchsorted(owner, owner)
    piece = place * PIECES // np.bincount(owner)[owner]
    squares = np.zeros((len(owner), len(observations.joints)))
    for which in range(PIECES):
        fitted = np.flatnonzero(piece != which)
        parts = tuple(rows.part(fitted) for rows in observations.joints)
        value = weighted_value(replace(observations, joints=parts, owner=owner[fitted]).by_joint)
        for j, rows in enumerate(observations.joints):
            residual = rows.left(value)
            total = np.concatenate([[0.0], np.cumsum(residual**2)])
            squares[piece == which, j] = np.diff(total[rows.starts])[piece == which]
    counts = np.array([rows.counts for rows in observations.joints]).T
    torque = np.array([max(part.torque_rms, np.finfo(float).tiny) for part in observations.by_joint])
    with np.errstate(invalid="ignore", divide="ignore"):
        left = np.sqrt(np.maximum(squares, 0.0) / counts) / torque
        relative = np.sqrt(np.sum(squares, axis=0) / np.sum(counts, axis=0)) / torque
    return left, relative


def far_less(
    left: tuple[Array, Array], other: tuple[Array, Array], most: float, *, poor: bool
) -> tuple[float, float] | None:
    """Compare what two readings leave on blocks that they were not fitted to.

    Parameters
    ----------
    left, other : tuple of ndarray
        What `held_out` says of the readings.
    most : float
        Share of the torque that the other may leave at most.
    poor : bool
        Whether joints that both readings explain say nothing.

    Returns
    -------
    tuple of float, or None
        What either leaves, geometric mean over joints, or over those that are hardly explained where the other leaves far less of
        these and less of all; None where it does neither, or not in most blocks.
    """
    said = np.ones(len(left[1]), dtype=bool) if not poor else np.maximum(left[1], other[1]) > POOR
    hardly = left[1] > HARDLY
    if mean(other[1][said]) >= min(MENDED * mean(left[1][said]), most):
        if not np.any(hardly) or mean(other[1]) >= mean(left[1]):
            return None
        said = hardly
    error, mended = mean(left[1][said]), mean(other[1][said])
    if mended >= min(MENDED * error, most) or not better(left[0], other[0]):
        return None
    return error, mended


def mean(left: Array) -> float:
    """Return the geometric mean over the joints that have rows."""
    known = left[np.isfinite(left)]
    return float(np.exp(np.mean(np.log(np.maximum(known, ROUNDING))))) if len(known) else 1.0


def better(left: Array, other: Array) -> bool:
    """Whether other residuals are smaller block by block, by a t test of the logarithms of their ratios."""
    from scipy.special import stdtrit

    both = np.isfinite(left) & np.isfinite(other)
    ratios = np.where(both, np.log(np.maximum(other, ROUNDING)) - np.log(np.maximum(left, ROUNDING)), 0.0)
    shared = np.sum(both, axis=1)
    mean = np.sum(ratios, axis=1)[shared > 0] / shared[shared > 0]
    if len(mean) < 2:
        return False
    spread = float(np.std(mean, ddof=1)) / np.sqrt(len(mean))
    return bool(np.mean(mean) + float(stdtrit(len(mean) - 1, 1.0 - SIGNIFICANCE_LEVEL)) * spread < 0.0)


def friction_pushes(value: Array, observations: Observations) -> NDArray[np.bool_]:
    """Return the joints whose estimated friction feeds energy in over the recorded motion, beyond its uncertainty."""
    robot = observations.model.robot
    friction = np.zeros(observations.parameters, dtype=bool)
    for term in observations.model.terms:
        if isinstance(term, Friction):
            friction[observations.model.place(term)] = True
    powers = np.zeros((robot.n, observations.parameters))
    for j, rows in enumerate(observations.joints):
        own = np.flatnonzero(friction[rows.columns])
        passed = 0.0
        for item, raws in zip(observations.data.recordings, observations.raw, strict=True):
            part, raw = max(zip(item.stretches, raws, strict=True), key=lambda pair: pair[0].samples)
            drive = robot.drive_sign[j] * part.motion.v[j]
            powers[j, rows.columns[own]] += raw[j][own] @ drive
            passed += float(np.sum(np.abs(part.torque[j] * drive)))
        if powers[j] @ value >= -PUSHING * passed:
            powers[j] = 0.0
    if not np.any(powers):
        return np.zeros(robot.n, dtype=bool)
    # How sure the power is takes more time than the power, and mostly no joint is suspected.
    covariance = wls(observations).covariance
    known = np.isfinite(np.diag(covariance))
    spread = np.where(known[:, None] & known, covariance, 0.0)
    std = np.sqrt(np.einsum("jp,pq,jq->j", powers, spread, powers))
    std[np.any(powers[:, ~known], axis=1)] = np.inf
    return np.asarray((powers @ value < -PUSHING_STD * std) & np.any(powers, axis=1))
