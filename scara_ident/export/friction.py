"""Friction as a URDF and an MJCF can hold it: Coulomb and viscous, at the joint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class JointFriction:
    """Coulomb and viscous friction of every joint, on the side where torque is recorded.

    Attributes
    ----------
    coulomb : ndarray, shape (n,)
        Recorded torque, N m (N); NaN where it is not known.
    viscous : ndarray, shape (n,)
        Recorded torque per speed of the joint, N m s/rad (N s/m, N m s/m); NaN where it is not known.
    """

    coulomb: Array
    viscous: Array


@dataclass(frozen=True, eq=False)
class JointSideFriction:
    """Friction as the exports write it.

    Attributes
    ----------
    coulomb, viscous : ndarray, shape (n,)
        Torque (force) at the joint, and that per speed of the joint; never negative, NaN where not known.
    notes : tuple of str
        What could not be taken over.
    """

    coulomb: Array
    viscous: Array
    notes: tuple[str, ...]


def joint_side(robot: Robot, friction: JointFriction | None) -> JointSideFriction:
    """Carry friction over the gear to the joint.

    A recorded torque u is one of ``u / row_scale`` at the joint, N u on the motor side. Speed is the joint's on
    both sides, so the viscous coefficient goes by the same factor, and where the gear reverses both the torque
    and its direction change sign: the factor is |N|.
    """
    if friction is None:
        return JointSideFriction(np.full(robot.n, np.nan), np.full(robot.n, np.nan), ())
    notes: list[str] = []
    found: list[Array] = []
    for word, values in (("Coulomb", friction.coulomb), ("viscous", friction.viscous)):
        given = np.asarray(values, dtype=float)
        if given.shape != (robot.n,):
            raise ValueError(f"{word} friction has shape {given.shape}; expected ({robot.n},)")
        for name, value in zip(robot.joints, given, strict=True):
            if np.isnan(value):
                notes.append(f"{name}: {word} friction is not known and was not written")
            elif value < 0.0:
                notes.append(
                    f"{name}: {word} friction is {value:.6g}; below zero it would drive the joint, so 0 was written"
                )
        # maximum keeps NaN
        found.append(np.maximum(given, 0.0) / np.abs(robot.row_scale))
    return JointSideFriction(found[0], found[1], tuple(notes))
