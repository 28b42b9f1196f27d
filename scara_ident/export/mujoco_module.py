"""What an MJCF cannot represent of an identified model: a Python module that installs it as passive forces."""

from __future__ import annotations

from collections.abc import Sequence

from scara_ident.arrays import Array
from scara_ident.export.code import constants, docstring, function, numbers
from scara_ident.export.friction import JointSideFriction
from scara_ident.export.traced_model import TracedModel

_TEXT = '''\
{doc}
from math import cos, exp, fabs, sin, tanh

import mujoco

{constants}


def install(model):
    """Make the joints of a MuJoCo model lose what was identified, in place of the friction that the MJCF was given.

    Sets `frictionloss`, `damping` and the actuators' bias, and gives MuJoCo a callback that takes `further` off as
    passive force. What depends on the acceleration sees that of the last step, one step late in a simulation and exact in
    `mj_inverse`. MuJoCo has one callback for all models: on others this one does nothing. `uninstall` takes it away.
    """
    joints = [model.joint(name) for name in JOINTS]
    places = [(int(joint.qposadr[0]), int(joint.dofadr[0])) for joint in joints]
    for (_, dof), name, loss, damping, offset in zip(places, JOINTS, FRICTIONLOSS, DAMPING, OFFSET):
        model.dof_frictionloss[dof] = loss
        model.dof_damping[dof] = damping
        actuator = model.actuator(name)
        actuator.biastype[:] = mujoco.mjtBias.mjBIAS_AFFINE
        actuator.biasprm[0] = -offset
    owner = model._address

    def passive(this, data):
        if this._address != owner:
            return
        torque = further(
            [data.qpos[place] for place, _ in places],
            [data.qvel[dof] for _, dof in places],
            [data.qacc[dof] for _, dof in places],
        )
        for (_, dof), value, side in zip(places, torque, SIDE):
            data.qfrc_passive[dof] -= value / side

    mujoco.set_mjcb_passive(passive)


def uninstall():
    """Take the callback away; the model keeps its friction."""
    mujoco.set_mjcb_passive(None)


def sign(x):
    """Return -1, 0 or 1."""
    return float(x > 0.0) - float(x < 0.0)


{further}
'''


def mujoco_module(further: TracedModel, friction: JointSideFriction, offset: Array, about: Sequence[str] = ()) -> str:
    """Write the module.

    Parameters
    ----------
    further : TracedModel
        Its ``friction`` is what is lost beyond dry and viscous friction and the offset.
    offset : ndarray, shape (n,)
        Recorded side.
    about : sequence of str, optional
        What the reader of the file should know, one line each.
    """
    robot = further.robot
    values = {
        "JOINTS": (robot.joints, "of the MJCF, in the order of q, v and a"),
        "SIDE": (numbers(robot.row_scale), f"recorded torque, {robot.effort_side} side, per torque at the joint"),
        "FRICTIONLOSS": (numbers(friction.coulomb), "at the joint"),
        "DAMPING": (numbers(friction.viscous), "at the joint"),
        "OFFSET": (numbers(offset), "of the recorded torque"),
    }
    said = "Return the torque lost beyond frictionloss, damping and offset, as recorded."
    return _TEXT.format(
        doc=docstring(
            f"What MuJoCo lacks of {robot.name}, as passive forces, by scara-ident: `install(model)`.", about
        ),
        constants=constants(values),
        further=function("further", said, further.trace, further.friction, robot.n),
    )
