"""Efforts that were logged without their sign: never negative, where a torque with signs explains them far better."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.observations import Observations
from scara_ident.model.urdf_torque import urdf_torques

# Rounds of fitting to signs and taking signs from the fit; they settle within ten where they settle at all.
ROUNDS = 20
# A fit that leaves less than this share of the torque is none to a magnitude: those of six arms left 18 to 51 %.
LEAST_LEFT = 0.1
# A share of the largest effort that counts as zero: resampling a log leaves rounding below it.
ZERO = 1e-9


def signed_fits(observations: Observations) -> dict[int, tuple[float, float]]:
    """Fit efforts that never change their sign as they are, and as magnitudes of a torque of both signs.

    Signs and parameters are found in turns, from where friction, or the URDF's bodies, change the sign; a joint that is
    loaded from one side only keeps its sign, and is explained no better.

    Parameters
    ----------
    observations : Observations

    Returns
    -------
    dict of int to (float, float)
        Of each joint that moves both ways under an effort of one sign, and is explained badly, what is left of the torque as a
        share of it, as logged and with signs.
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
        if plain > LEAST_LEFT * size:
            inverse = _inverse(rows.table[:-1])
            signed = min(_folded(observations, j, start, inverse) for start in _starts(observations, j))
            found[j] = plain / size, signed / float(np.linalg.norm(rows.table[-1]))
    return found


def _starts(observations: Observations, joint: int) -> Iterator[list[Array]]:
    """Give for each usable stretch the torque by whose sign a search begins."""
    parts = [part for part in observations.data.stretches if part.usable]
    yield [part.motion.v[joint] for part in parts]
    gravity = np.asarray(observations.model.robot.model.gravity.linear, dtype=float)
    bodies = [np.append(1.0, gravity) @ urdf_torques(observations.model.robot, part.motion)[joint] for part in parts]
    yield bodies
    # Half of what there is may be friction.
    half = float(np.median(np.abs(np.concatenate([part.torque[joint] for part in parts]))))
    yield [own + half * np.sign(part.motion.v[joint]) for own, part in zip(bodies, parts, strict=True)]


def _folded(observations: Observations, joint: int, start: list[Array], inverse: Array) -> float:
    """Return the norm of what is left of the rows where each effort has the sign of the torque that is fitted to it."""
    rows = observations.joints[joint]
    pairs = [
        (part, raw[joint])
        for part, raw in zip(
            observations.data.stretches, (raw for item in observations.raw for raw in item), strict=True
        )
        if part.usable
    ]
    signs = [np.where(own < 0.0, -1.0, 1.0) for own in start]
    least = np.inf
    for _ in range(ROUNDS):
        made = [
            part.rows(joint, (sign * part.torque[joint])[None])[0] for (part, _), sign in zip(pairs, signs, strict=True)
        ]
        torque = np.concatenate(made)
        value = torque @ inverse
        least = min(least, float(np.linalg.norm(torque - value @ rows.table[:-1])))
        turned = [np.where(value @ raw < 0.0, -1.0, 1.0) for _, raw in pairs]
        if all(np.array_equal(new, old) for new, old in zip(turned, signs, strict=True)):
            break
        signs = turned
    return least


def _inverse(columns: Array) -> Array:
    """Return what gives the least-squares values of columns (k, N) from a torque on their rows, shape (N, k)."""
    size = np.linalg.norm(columns, axis=1)
    scale = np.where(size > 0.0, 1.0 / np.where(size > 0.0, size, 1.0), 0.0)
    return np.asarray(np.linalg.pinv(columns * scale[:, None]) * scale)
