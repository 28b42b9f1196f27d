"""Friction as a URDF and an MJCF can hold it: Coulomb and viscous, at the joint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.estimate import Estimate
from scara_ident.model.terms import Friction
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
    left_out : tuple of str
        Parameters of the model that neither format can hold.
    """

    coulomb: Array
    viscous: Array
    left_out: tuple[str, ...] = ()


def friction_of(estimate: Estimate) -> JointFriction | None:
    """Read Coulomb and viscous friction from an estimate.

    Returns
    -------
    JointFriction or None
        None where the model has no friction. A coefficient that the model lacks, or that the data leave open,
        is NaN. Every other column beside the rigid body's is in ``left_out``.
    """
    model = estimate.model
    term = next((term for term in model.terms if isinstance(term, Friction)), None)
    if term is None:
        return None
    place = model.place(term)
    known = np.where(estimate.undetermined, np.nan, estimate.value)[place].reshape(model.robot.n, len(term.powers))

    def coefficient(power: int) -> Array:
        return known[:, term.powers.index(power)] if power in term.powers else np.full(model.robot.n, np.nan)

    higher = tuple(
        column.name
        for k, column in enumerate(term.columns)
        if term.powers[k % len(term.powers)] > 1  # columns go joint by joint
    )
    others = tuple(
        column.name
        for other in model.terms
        if other is not term and other is not model.rigid_body
        for column in other.columns
    )
    return JointFriction(coefficient(0), coefficient(1), higher + others)


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
    if friction.left_out:
        notes.append(f"left out, as the format has no place for it: {', '.join(friction.left_out)}")
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
