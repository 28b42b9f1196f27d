"""The URDF's values of a model's parameters."""

from __future__ import annotations

import numpy as np

from scara_ident.arrays import Array
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms.rigid_body import RigidBody
from scara_ident.robot.robot import Robot


def urdf_values(model: TorqueModel) -> Array:
    """Return the URDF's values of a model's parameters, shape (p,).

    NaN where it has none: friction, offsets and effects, and sums with a rotor whose inertia nobody stated.
    """
    found = np.full(len(model.columns), np.nan)
    found[model.place(model.rigid_body)] = urdf_base_values(model.robot, model.rigid_body)
    return found


def urdf_base_values(robot: Robot, term: RigidBody) -> Array:
    """Return the URDF's values of the base parameters, shape (b,), NaN in sums with a rotor whose inertia nobody stated."""
    stated = term.base.grouping @ robot.standard_parameters()
    rotors = term.base.grouping[:, 10 * robot.n :][:, ~robot.rotor_stated]
    stated[np.any(rotors != 0.0, axis=1)] = np.nan
    return np.asarray(stated[term.kept])
