"""The nominal bodies that the prior starts from: the URDF's, made physical where they are not."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from scara_ident.arrays import Array
from scara_ident.estimation.consistent.bodies import PACKED_IDENTITY, pack, packed_pseudo_inertia, unpacking
from scara_ident.model.base_parameters import pseudo_inertia
from scara_ident.robot.robot import Robot
from scara_ident.robot.rotors import LINK_SHARE

# A nominal body's smallest second moment about its centre of mass is at least this share of its largest: the
# prior is then finite, and a plate or rod stays one to 3 % of its length.
THINNEST = 1e-3
# A body given without mass is a solid ball of this radius as a share of the arm's mean link length.
BALL_RADIUS = 0.25
# Length of an arm that has no second joint to take a length from, m.
DEFAULT_LENGTH = 0.4
# A guess of a rotor, see `Robot.rotor_guess`, is an order of magnitude: the distance from it weighs so little beside those
# of bodies, which the URDF gives.
GUESS_WEIGHT = 0.01


@dataclass(frozen=True, eq=False)
class Nominal:
    """Nominal bodies and rotors of an arm, all of which could exist.

    Attributes
    ----------
    pseudo_inertia : ndarray, shape (n, 4, 4)
        Positive definite, in the order of the robot's joints.
    armature : ndarray, shape (n,)
        Positive, kg m^2 or kg.
    rotor_weights : ndarray, shape (n,)
        Of the rotors' distances from it, beside those of bodies: 1, and `GUESS_WEIGHT` where it was guessed.
    to_standard : ndarray, shape (11 n, 11 n)
        Takes bodies and rotors relative to nominal (see `relative`) to the standard parameters.
    notes : tuple of str
        What the URDF gave that could not be used, and what stands in its place.
    """

    pseudo_inertia: Array
    armature: Array
    rotor_weights: Array
    to_standard: Array
    notes: tuple[str, ...]

    @property
    def n(self) -> int:
        """Number of bodies."""
        return len(self.armature)

    @property
    def relative(self) -> Array:
        """The nominal arm relative to itself, shape (11 n,): packed identities, then ones."""
        return np.concatenate([np.tile(PACKED_IDENTITY, self.n), np.ones(self.n)])


def nominal(robot: Robot) -> Nominal:
    """Take the nominal bodies of a robot and make them physical."""
    standard = robot.standard_parameters()
    bodies = standard[: 10 * robot.n].reshape(robot.n, 10)
    length = _length(robot)
    masses = bodies[:, 0][bodies[:, 0] > 0.0]
    mass = float(np.median(masses)) if masses.size else 1.0
    matrices, notes = [], []
    for name, body in zip(robot.links, bodies, strict=True):
        matrix, note = _physical(pseudo_inertia(body), mass, BALL_RADIUS * length)
        matrices.append(matrix)
        if note:
            notes.append(f"{name}: {note}")
    stacked = np.array(matrices)
    armature = standard[10 * robot.n :].copy()
    unknown = ~(armature > 0.0)
    if np.any(unknown):
        guess = robot.rotor_guess.armature
        # Neither a limit nor a body of the URDF tells what a joint's rotor may be: the bodies taken in their place do.
        guess = np.where(guess > 0.0, guess, LINK_SHARE * _moved(robot, stacked)) if np.any(guess <= 0.0) else guess
        armature[unknown] = guess[unknown]
        names = ", ".join(name for name, is_unknown in zip(robot.joints, unknown, strict=True) if is_unknown)
        notes.append(
            f"rotor inertia of {names}: stated neither in the URDF nor in robot.yaml; where the torque does not "
            f"determine it, it stays near that of a motor of that size"
        )
    weights = np.where(unknown, GUESS_WEIGHT, 1.0)
    return Nominal(stacked, armature, weights, _to_standard(stacked, armature), tuple(notes))


def _physical(matrix: Array, mass: float, radius: float) -> tuple[Array, str]:
    """Return a positive definite pseudo-inertia near a given one, and what was wrong with the given one."""
    if not matrix[3, 3] > 0.0 or not np.all(np.isfinite(matrix)):
        ball = np.diag([*(0.2 * mass * radius**2,) * 3, mass])
        return ball, f"the URDF gives no mass; the prior uses a ball of {mass:.3g} kg and {radius:.3g} m"
    own = float(matrix[3, 3])
    centre = matrix[:3, 3] / own
    central = matrix[:3, :3] - own * np.outer(centre, centre)
    values, vectors = np.linalg.eigh(central)
    note = ""
    if not values[-1] > 1e-12 * own * radius**2:
        values = np.full(3, 0.2 * own * radius**2)
        note = f"the URDF gives a point mass; the prior uses a ball of {radius:.3g} m"
    floor = THINNEST * values[-1]
    if values[0] < floor:
        if values[0] < -1e-6 * values[-1]:
            note = (
                "no body can have the URDF's inertia (it violates the triangle inequality); the prior uses one near it"
            )
        values = np.maximum(values, floor)
    central = vectors * values @ vectors.T
    result = np.empty((4, 4))
    result[:3, :3] = central + own * np.outer(centre, centre)
    result[:3, 3] = result[3, :3] = own * centre
    result[3, 3] = own
    return result, note


def _length(robot: Robot) -> float:
    """Mean distance between successive joints; a change of frame leaves it alone."""
    placements = [robot.model.jointPlacements[int(k) + 1].translation for k in robot.order]
    distances = [float(np.linalg.norm(p)) for p in placements[1:]]
    mean = float(np.mean(distances)) if distances else 0.0
    return mean if mean > 0.0 else DEFAULT_LENGTH


def _moved(robot: Robot, matrices: Array) -> Array:
    """Inertia that each joint moves at the zero position, shape (n,)."""
    model = robot.model.copy()
    to_parameters = np.linalg.inv(packed_pseudo_inertia())
    for place, k in enumerate(robot.order):
        parameters = to_parameters @ pack(matrices[place])
        model.inertias[int(k) + 1] = pin.Inertia.FromDynamicParameters(parameters)
    mass_matrix = pin.crba(model, model.createData(), pin.neutral(model))
    return np.array(np.diag(mass_matrix)[robot.order], dtype=float)


def _to_standard(matrices: Array, armature: Array) -> Array:
    n = len(armature)
    result = np.zeros((11 * n, 11 * n))
    to_parameters = np.linalg.inv(packed_pseudo_inertia())
    unpacked = unpacking()
    for i, matrix in enumerate(matrices):
        root = np.linalg.cholesky(matrix)
        # Row by row, C Q C.T is kron(C, C) @ Q.
        stretched = np.kron(root, root) @ unpacked
        result[10 * i : 10 * i + 10, 10 * i : 10 * i + 10] = to_parameters @ np.linalg.pinv(unpacked) @ stretched
    result[10 * n :, 10 * n :] = np.diag(armature)
    return result
