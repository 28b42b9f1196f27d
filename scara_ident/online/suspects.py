"""Suspects of the detector: torques that a payload, other friction or another torque scale would bring."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.effects.links import point_mass, tool_of
from scara_ident.effects.payload import PayloadChange
from scara_ident.model.model import TorqueModel
from scara_ident.model.terms.friction import Friction


@dataclass(frozen=True, eq=False)
class Suspects:
    """Causes of a change, as torques on the rows of a block.

    Attributes
    ----------
    names : tuple of (str, str or None, str)
        Effect, joint, and unit of the size; "1" is a share.
    joints : tuple of (int, ndarray)
        Those that are a share of what the model predicts: joint and the parameters (p,) that take part, 1 or 0.
    payload : ndarray, shape (p,)
        What 1 kg at the tool adds to the parameters.
    """

    names: tuple[tuple[str, str | None, str], ...]
    joints: tuple[tuple[int, Array], ...]
    payload: Array

    def torques(self, rows: Sequence[Array], value: Array) -> Array:
        """Return the torque of one unit of each cause on the rows of all joints, shape (N, c).

        Parameters
        ----------
        rows : sequence of ndarray, shape (N_j, p)
            Of each joint.
        value : ndarray, shape (p,)
        """
        ends = np.cumsum([0, *(len(own) for own in rows)])
        found = np.zeros((ends[-1], len(self.names)))
        for k, (joint, part) in enumerate(self.joints):
            found[ends[joint] : ends[joint + 1], k] = rows[joint] @ (part * value)
        if np.any(self.payload):
            found[:, len(self.joints)] = np.concatenate([own @ self.payload for own in rows])
        return found


def suspects_of(model: TorqueModel) -> Suspects:
    """Return friction and torque scale of each joint, and a payload at the tool where the model can tell one."""
    total, robot = len(model.columns), model.robot
    friction = np.zeros(total)
    for term in model.terms:
        if isinstance(term, Friction):
            friction[model.place(term)] = 1.0
    names: list[tuple[str, str | None, str]] = []
    joints: list[tuple[int, Array]] = []
    for effect, part in (("friction", friction), ("torque_scale", np.ones(total))):
        for j, joint in enumerate(robot.joints):
            own = np.zeros(total)
            own[model.active[j]] = part[model.active[j]]
            if np.any(own):
                names.append((effect, joint, "1"))
                joints.append((j, own))
    payload = np.zeros(total)
    term = model.rigid_body
    tool = tool_of(robot)
    standard = np.zeros(term.base.grouping.shape[1])
    standard[10 * tool.joint : 10 * tool.joint + 10] = point_mass(tool.point)
    payload[model.place(term)] = term.base.grouping[term.kept] @ standard
    if np.any(payload):
        names.append((PayloadChange.name, None, "kg"))
    return Suspects(tuple(names), tuple(joints), payload)
