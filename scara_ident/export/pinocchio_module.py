"""An identified model for Pinocchio: a Python module that loads the URDF beside it and sets what a URDF cannot represent."""

from __future__ import annotations

from collections.abc import Sequence

from scara_ident.arrays import Array
from scara_ident.export.code import constants, docstring, function, numbers
from scara_ident.export.friction import JointSideFriction
from scara_ident.export.traced_model import TracedModel

_TEXT = '''\
{doc}
from math import cos, exp, fabs, sin, tanh
from pathlib import Path

import numpy as np
import pinocchio as pin

{constants}


def load():
    """Return the model with armature, dry friction and damping at the joints, and rotors.

    `pin.rnea` and `pin.aba` count the armature in; `inverse_dynamics` adds friction and damping.
    """
    return _model(FRICTION, DAMPING)


def load_with_effects():
    """Return the model with the friction that goes with the effects, and `further` for `inverse_dynamics`."""
    return _model(FRICTION_WITH_EFFECTS, DAMPING_WITH_EFFECTS), further


def inverse_dynamics(model, data, q, v, a, further=None):
    """Return the torque at the joints: bodies, armature, friction, damping, and further torques if they are given.

    q is a configuration (`configuration` makes it of angles); v, a and the result are in the model's order.
    """
    torque = pin.rnea(model, data, q, v, a)
    torque = torque + model.damping * v + model.upperDryFrictionLimit * np.sign(v)
    if further is not None:
        places = _places(model)
        angles = [angle for angle in _angles(model, q)]
        rows = further([angles[k] for k in places], [v[k] for k in places], [a[k] for k in places])
        torque[places] += np.array(rows) / np.array(SIDE)
    return torque


def configuration(model, angles):
    """Return Pinocchio's configuration of positions in the order of JOINTS, rad or m."""
    q = pin.neutral(model)
    for name, value in zip(JOINTS, angles):
        joint = model.joints[model.getJointId(name)]
        q[joint.idx_q : joint.idx_q + joint.nq] = value if joint.nq == 1 else (np.cos(value), np.sin(value))
    return q


def _angles(model, q):
    angles = np.zeros(model.nv)
    for joint in list(model.joints)[1:]:
        part = q[joint.idx_q : joint.idx_q + joint.nq]
        angles[joint.idx_v] = part[0] if joint.nq == 1 else np.arctan2(part[1], part[0])
    return angles


def _places(model):
    return [model.joints[model.getJointId(name)].idx_v for name in JOINTS]


def _model(friction, damping):
    model = pin.buildModelFromUrdf(str(Path(__file__).with_name(URDF)))
    still = [model.getJointId(name) for name in LOCKED]
    if still:
        where = pin.neutral(model)
        for index, value in zip(still, LOCKED.values()):
            joint = model.joints[index]
            where[joint.idx_q : joint.idx_q + joint.nq] = value if joint.nq == 1 else (np.cos(value), np.sin(value))
        model = pin.buildReducedModel(model, still, where)
    model.gravity.linear = np.array(GRAVITY)
    places = _places(model)
    model.armature[places] = ARMATURE
    model.rotorInertia[places] = ROTOR_INERTIA
    model.rotorGearRatio[places] = REDUCTION
    model.damping[places] = damping
    model.upperDryFrictionLimit[places] = friction
    model.lowerDryFrictionLimit[places] = [-value for value in friction]
    return model


def sign(x):
    """Return -1, 0 or 1."""
    return float(x > 0.0) - float(x < 0.0)


{further}
'''


def pinocchio_module(
    urdf: str,
    armature: Array,
    alone: JointSideFriction,
    beside: JointSideFriction,
    further: TracedModel,
    about: Sequence[str] = (),
) -> str:
    """Write the module.

    Parameters
    ----------
    urdf : str
        Name of the identified URDF, which stands beside the module.
    armature : ndarray, shape (n,)
        At the joint.
    alone, beside : JointSideFriction
        Friction without, and with, what is beyond dry and viscous friction.
    further : TracedModel
        Its ``friction`` is what is beyond that.
    about : sequence of str, optional
        What the reader of the file should know, one line each.
    """
    robot = further.robot
    values = {
        "URDF": (urdf, "beside this file"),
        "JOINTS": (robot.joints, "in the order of all numbers here"),
        "LOCKED": (dict(robot.locked), "joints that stand still, rad or m"),
        "GRAVITY": (numbers(robot.model.gravity.linear), "m/s^2"),
        "ARMATURE": (numbers(armature), "at the joint, kg m^2 or kg"),
        "ROTOR_INERTIA": (numbers(armature / robot.reduction**2), "of the motor, kg m^2"),
        "REDUCTION": (numbers(robot.reduction), "motor turns per joint turn, motor rad per metre where it slides"),
        "SIDE": (numbers(robot.row_scale), f"recorded torque, {robot.effort_side} side, per torque at the joint"),
        "FRICTION": (numbers(alone.coulomb), "dry friction at the joint, N m or N"),
        "DAMPING": (numbers(alone.viscous), "at the joint, N m s/rad or N s/m"),
        "FRICTION_WITH_EFFECTS": (numbers(beside.coulomb), "beside `further`"),
        "DAMPING_WITH_EFFECTS": (numbers(beside.viscous), "beside `further`"),
    }
    said = "Return the torque beyond bodies, armature, dry friction and damping, as recorded, in the order of JOINTS."
    return _TEXT.format(
        doc=docstring(f"{robot.name} for Pinocchio, by scara-ident: `load()`, `load_with_effects()`.", about),
        constants=constants(values),
        further=function("further", said, further.trace, further.friction, robot.n),
    )
