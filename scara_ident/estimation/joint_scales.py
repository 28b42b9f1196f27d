"""How many times the torque of the URDF's bodies each joint's recorded effort is."""

from __future__ import annotations

import numpy as np

from scara_ident.estimation.information import Information, triangular
from scara_ident.estimation.observations import Observations

# The URDF's torque tells the scale of a joint where it leaves less than this share of what friction and a rotor alone leave.
MAX_UNEXPLAINED = 0.35


def joint_scales(observations: Observations) -> dict[int, float]:
    """Return the effort of each joint as a multiple of the torque of the URDF's bodies, where these explain it.

    Friction and the joint's rotor are free beside them: a URDF states no rotor, whose inertia may be as large as the links', so
    what the joint's acceleration alone asks for tells no scale.

    Parameters
    ----------
    observations : Observations
        Of a model of the bodies and friction.

    Returns
    -------
    dict of float
        By place of the joint; negative where the signs are opposite.
    """
    model = observations.model
    robot, rigid, term = model.robot, model.place(model.rigid_body), model.rigid_body
    grouping = term.base.grouping[term.kept]
    stated = grouping @ robot.standard_parameters()
    found: dict[int, float] = {}
    for j, own in enumerate(observations.by_joint):
        bodies, acting = own.factor[:, rigid], observations.joints[j].columns
        others = own.factor[:, acting[(acting < rigid.start) | (acting >= rigid.stop)]]
        nominal, rotor = bodies @ stated, bodies @ grouping[:, 10 * robot.n + j]
        if not np.any(nominal):
            continue
        columns = np.column_stack([others, rotor, nominal, own.factor[:, -1]])
        whole = Information(triangular(columns), own.rows)
        scale = whole.solve().value[-1]
        left, without = whole.rms(), whole.select(range(whole.parameters - 1)).rms()
        if scale and left < MAX_UNEXPLAINED * without:
            found[j] = float(scale)
    return found
