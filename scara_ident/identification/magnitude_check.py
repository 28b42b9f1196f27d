"""Efforts that were logged without their sign: never negative, where the magnitude of a torque with signs predicts them far better."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.estimation.observations import Observations
from scara_ident.identification.channel_comparison import PIECES, better
from scara_ident.identification.channel_fault import MENDED
from scara_ident.model.urdf_torque import urdf_torques
from scara_ident.motion.prepared import PreparedStretch

# Rounds of fitting to signs and taking signs from the fit; they settle within ten where they settle at all.
ROUNDS = 20
# A fit that leaves less than this share of the torque is none to a magnitude: those of six arms left 18 to 51 %.
MIN_UNEXPLAINED = 0.1
# A share of the largest effort that counts as zero: resampling a log leaves rounding below it.
ZERO = 1e-9
# Directions that columns show by less than this share of the best are not determined by the rows that are left where some are held out.
SHOWN = 1e-3
# The torque whose sign is missing is so many times what is left where it was not fitted, as a sign that chance gave is not.
SEEN = 3.0


def unsigned_efforts(observations: Observations) -> dict[int, tuple[float, float]]:
    """Return the joints whose effort is surely the magnitude of a torque of both signs.

    A sign for every sample fits much, above all where an arm mostly stands: with half of what is left gone from the fit, what
    counts is what a magnitude predicts of blocks of time that neither its signs nor its parameters were fitted to.

    Parameters
    ----------
    observations : Observations

    Returns
    -------
    dict of int to (float, float)
        Of each such joint what is left of the effort held out, as a share of it, by a torque of its own sign and by a magnitude.
    """
    found = {}
    for j, tried in signed_fits(observations).items():
        if tried.left < MENDED * tried.plain:
            said = _predicted(tried.joint, tried.signs)
            if said is not None:
                found[j] = said
    return found


@dataclass(frozen=True, eq=False)
class SignedFit:
    """An effort that never changes its sign, fitted as a magnitude.

    Attributes
    ----------
    plain, left : float
        What is left of the torque, as a share of it, as logged and with signs.
    signs : list of ndarray, shape (N,)
        Of every stretch.
    """

    plain: float
    left: float
    joint: _Joint
    signs: list[Array]


def signed_fits(observations: Observations) -> dict[int, SignedFit]:
    """Fit efforts that never change their sign as they are, and as magnitudes of a torque of both signs.

    Signs and parameters are found in turns, from where friction, or the URDF's bodies, change the sign; a joint that is
    loaded from one side only keeps its sign, and is explained no better. It is done for each joint that moves both ways under an
    effort of one sign, and is explained badly.
    """
    found = {}
    parts = [part for part in observations.data.stretches if part.usable]
    for j, rows in enumerate(observations.joints):
        torque = np.concatenate([part.torque[j] for part in parts])
        speed = np.concatenate([np.where(part.used[j], part.motion.v[j], 0.0) for part in parts])
        small = ZERO * float(np.max(np.abs(torque), initial=0.0))
        one_sign = np.all(torque >= -small) or np.all(torque <= small)
        if not one_sign or not (np.any(speed > 0.0) and np.any(speed < 0.0)) or not rows.table.shape[1]:
            continue
        alone = observations.by_joint[j]
        size, plain = alone.torque_rms, alone.rms()
        if plain > MIN_UNEXPLAINED * size:
            joint = _joint(observations, j)
            fit = _fitted(joint)
            found[j] = SignedFit(plain / size, fit.left / float(np.linalg.norm(rows.table[-1])), joint, fit.signs)
    return found


@dataclass(frozen=True, eq=False)
class _Joint:
    """What recordings say of one joint, sample by sample and row by row.

    Attributes
    ----------
    place : int
    parts : list of PreparedStretch
        The usable ones.
    raw : list of ndarray, shape (k, N) each
        Columns at every sample.
    starts : list of list of ndarray, shape (N,)
        Torques by whose sign searches begin, on every stretch.
    columns : ndarray, shape (k, rows)
    torque : ndarray, shape (rows,)
    block, fold : ndarray of int, shape (rows,)
        Block of time of each row, and in which turn it is held out: every few blocks, for a motion may be in one piece.
    """

    place: int
    parts: list[PreparedStretch]
    raw: list[Array]
    starts: list[list[Array]]
    columns: Array
    torque: Array
    block: NDArray[np.intp]
    fold: NDArray[np.intp]

    def rows(self, signals: list[Array]) -> Array:
        """Return a signal of every stretch on the rows, shape (rows,)."""
        return np.concatenate(
            [part.rows(self.place, own[None])[0] for part, own in zip(self.parts, signals, strict=True)]
        )

    def by_block(self, left: Array) -> Array:
        """Return the rms of each block that has rows, shape (blocks, 1)."""
        count = np.bincount(self.block)
        return np.sqrt(np.bincount(self.block, left**2)[count > 0] / count[count > 0])[:, None]


@dataclass(frozen=True, eq=False)
class _Fit:
    """Parameters (k,), the signs of all samples that they were fitted with, and the norm of what is left."""

    value: Array
    signs: list[Array]
    left: float


def _joint(observations: Observations, place: int) -> _Joint:
    rows, owner = observations.joints[place], observations.owner
    columns = (raw[place] for item in observations.raw for raw in item)
    pairs = [(part, raw) for part, raw in zip(observations.data.stretches, columns, strict=True) if part.usable]
    parts = [part for part, _ in pairs]
    block = np.repeat(np.arange(len(owner)), np.diff(rows.starts))
    fold = (np.arange(len(owner)) - np.searchsorted(owner, owner)) % PIECES
    starts = list(_starts(observations, parts, place))
    table = rows.table
    return _Joint(place, parts, [raw for _, raw in pairs], starts, table[:-1], table[-1], block, fold[block])


def _starts(observations: Observations, parts: list[PreparedStretch], joint: int) -> Iterator[list[Array]]:
    """Give for each usable stretch the torque by whose sign a search begins."""
    yield [part.motion.v[joint] for part in parts]
    gravity = np.asarray(observations.model.robot.model.gravity.linear, dtype=float)
    bodies = [np.append(1.0, gravity) @ urdf_torques(observations.model.robot, part.motion)[joint] for part in parts]
    yield bodies
    # Half of what there is may be friction.
    half = float(np.median(np.abs(np.concatenate([part.torque[joint] for part in parts]))))
    yield [own + half * np.sign(part.motion.v[joint]) for own, part in zip(bodies, parts, strict=True)]


def _fitted(joint: _Joint) -> _Fit:
    """Return the fit of signs and parameters to all rows that leaves least."""
    every, inverse = np.ones(len(joint.torque), dtype=bool), _inverse(joint.columns)
    fits = [_settled(joint, [_signs(own) for own in start], inverse, every) for start in joint.starts]
    return min(fits, key=lambda fit: fit.left)


def _settled(joint: _Joint, signs: list[Array], inverse: Array, use: NDArray[np.bool_]) -> _Fit:
    """Return the fit to some rows where each effort has the sign of the torque that is fitted to it, from signs on."""
    best = _Fit(np.zeros(len(joint.columns)), signs, np.inf)
    for _ in range(ROUNDS):
        torque = joint.rows([sign * part.torque[joint.place] for part, sign in zip(joint.parts, signs, strict=True)])
        value = torque[use] @ inverse
        left = float(np.linalg.norm(torque[use] - value @ joint.columns[:, use]))
        if left < best.left:
            best = _Fit(value, signs, left)
        turned = [_signs(value @ raw) for raw in joint.raw]
        if all(np.array_equal(new, old) for new, old in zip(turned, signs, strict=True)):
            break
        signs = turned
    return best


def _predicted(joint: _Joint, signs: list[Array]) -> tuple[float, float] | None:
    """Return what a torque, and the magnitude of one, leave of rows held out, where the missing sign is seen there; else None.

    Signs are those of a fit to all rows.
    """
    size = float(np.linalg.norm(joint.torque))
    side = 1.0 if sum(float(np.sum(part.torque[joint.place])) for part in joint.parts) >= 0.0 else -1.0
    # An offset keeps a sign too, of which some models have none.
    plain = np.vstack([joint.columns, joint.rows([np.ones(part.samples) for part in joint.parts])])
    as_logged, as_magnitude, torque = (np.zeros(len(joint.torque)) for _ in range(3))
    for fold in range(PIECES):
        held = joint.fold == fold
        if np.all(held) or not np.any(held):
            continue
        use = ~held
        value = joint.torque[use] @ _inverse(plain[:, use], SHOWN)
        as_logged[held] = joint.torque[held] - value @ plain[:, held]
        fit = _settled(joint, signs, _inverse(joint.columns[:, use], SHOWN), use)
        signed = [fit.value @ raw for raw in joint.raw]
        # The effort itself is predicted: signs that change fast would leave nothing of it within the band.
        as_magnitude[held] = (joint.torque - side * joint.rows([np.abs(own) for own in signed]))[held]
        torque[held] = joint.rows(signed)[held]
    left = float(np.linalg.norm(as_magnitude))
    if left >= MENDED * float(np.linalg.norm(as_logged)):
        return None
    # A torque and its opposite have one magnitude.
    lesser = min((torque[torque < 0.0], torque[torque > 0.0]), key=lambda own: float(own @ own))
    seen = float(np.sqrt(np.mean(lesser**2))) if len(lesser) else 0.0
    if seen < SEEN * left / np.sqrt(len(torque)) or not better(joint.by_block(as_logged), joint.by_block(as_magnitude)):
        return None
    return float(np.linalg.norm(as_logged)) / size, left / size


def _signs(torque: Array) -> Array:
    return np.where(torque < 0.0, -1.0, 1.0)


def _inverse(columns: Array, shown: float = 1e-15) -> Array:
    """Return what gives the least-squares values of columns (k, N) from a torque on their rows, shape (N, k).

    Directions that rows show by less than a share of the best stay zero.
    """
    size = np.linalg.norm(columns, axis=1)
    scale = np.where(size > 0.0, 1.0 / np.where(size > 0.0, size, 1.0), 0.0)
    return np.asarray(np.linalg.pinv(columns * scale[:, None], rcond=shown) * scale)
