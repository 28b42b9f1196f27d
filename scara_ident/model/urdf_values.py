"""What the URDF says of a model's parameters."""

from __future__ import annotations

import numpy as np

from scara_ident.arrays import Array
from scara_ident.model.model import TorqueModel


def urdf_values(model: TorqueModel) -> Array:
    """Return the URDF's values of a model's parameters, shape (p,).

    NaN where it has none: friction, offsets and effects, and sums with a rotor whose inertia nobody stated.
    """
    robot, term = model.robot, model.rigid_body
    stated = term.base.grouping @ robot.standard_parameters()
    rotors = term.base.grouping[:, 10 * robot.n :][:, ~robot.rotor_stated]
    stated[np.any(rotors != 0.0, axis=1)] = np.nan
    found = np.full(len(model.columns), np.nan)
    found[model.place(term)] = stated[term.kept]
    return found
