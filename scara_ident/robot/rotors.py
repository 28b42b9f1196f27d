"""A guess of the inertia of rotors that nobody stated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from scara_ident.arrays import Array

# Jm = COEFFICIENT (T / 1 N m)^EXPONENT with the largest torque T of the motor: least squares in logarithms over twelve
# servo actuators with strain wave gears, sizes 17 to 40 and ratios 50 to 160 (Harmonic Drive, FHA-C series, table of
# specifications: maximum torque and inertia at the output), which it meets within a factor of two.
COEFFICIENT, EXPONENT = 1.5e-4, 1.2
# Factor that is one standard deviation of the guess's logarithm. The drives of Franka's FR3 (its makers' figures) and of
# the SCARA03 (Indri et al. 2002), made otherwise, lie within factors of 2.8 and 4.1 of the rule.
GUESS_FACTOR = 3.0
# Reduction of an arm's joint where none is stated: motor turns per turn, and per metre of a screw with 20 mm lead.
USUAL_REDUCTION, USUAL_SCREW = 100.0, 314.0
# Where no effort limit tells the motor's size its rotor is given this share of what the links' masses alone make the joint move.
LINK_SHARE = 0.1
# Poses over which that is averaged.
_POSES = 40


@dataclass(frozen=True, eq=False)
class RotorGuess:
    """Armatures as large as the size of the motors suggests: orders of magnitude, not data.

    Attributes
    ----------
    armature : ndarray, shape (n,)
        N^2 Jm at the joint, kg m^2 or kg; 0 where neither a limit nor a link tells anything.
    by_limit : ndarray of bool, shape (n,)
        Where it follows from the effort limit; elsewhere the links did.
    """

    armature: Array
    by_limit: NDArray[np.bool_]


def guess_rotors(
    model: pin.Model, order: NDArray[np.intp], reduction: Array, effort_limit: Array, prismatic: NDArray[np.bool_]
) -> RotorGuess:
    """Guess the armature of every joint.

    Parameters
    ----------
    order : ndarray of int, shape (n,)
        Velocity index of each joint.
    reduction, effort_limit : ndarray, shape (n,)
        A reduction of 1 or -1 counts as not stated, an infinite limit as none.
    prismatic : ndarray of bool, shape (n,)
    """
    usual = np.where(prismatic, USUAL_SCREW, USUAL_REDUCTION)
    gear = np.where(np.abs(reduction) == 1.0, usual, np.abs(reduction))
    by_limit = np.isfinite(effort_limit) & (effort_limit > 0.0)
    torque = np.where(by_limit, effort_limit, 0.0) / gear
    by_motor = gear**2 * COEFFICIENT * torque**EXPONENT
    armature = by_motor if np.all(by_limit) else np.where(by_limit, by_motor, LINK_SHARE * _moved(model, order))
    return RotorGuess(np.asarray(armature), by_limit)


def _moved(model: pin.Model, order: NDArray[np.intp]) -> Array:
    """Mean inertia that the links' bodies make each joint move, the others held, shape (n,)."""
    data, rng = model.createData(), np.random.default_rng(0)
    total = np.zeros(model.nv)
    for _ in range(_POSES):
        q = pin.integrate(model, pin.neutral(model), rng.uniform(-1.0, 1.0, model.nv))
        total += np.diag(pin.crba(model, data, q))
    return np.maximum(total[order] / _POSES, 0.0)
