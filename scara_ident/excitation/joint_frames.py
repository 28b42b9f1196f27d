"""Where the joints of an arm are at many postures at once."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.excitation.tool import rotation
from scara_ident.model.regressor.recursion import JointGeometry, joint_geometry
from scara_ident.robot.kinematics import place_of
from scara_ident.robot.robot import Robot


@dataclass(frozen=True, eq=False)
class JointFrames:
    """Where the joints are at N postures, in the base frame; axis and origin in the robot's order of joints.

    Attributes
    ----------
    turn, place : ndarray, shapes (J, 3, 3, N) and (J, 3, N)
        Frames of Pinocchio's joints, the base first.
    axis, origin : ndarray, shape (n, 3, N)
    prismatic : ndarray of bool, shape (n,)
    """

    turn: Array
    place: Array
    axis: Array
    origin: Array
    prismatic: NDArray[np.bool_]

    def centres(self, joints: NDArray[np.intp], points: Array) -> Array:
        """Return where points (S, 3) fixed to joints are, shape (S, 3, N)."""
        return np.asarray(np.einsum("sabN,sb->saN", self.turn[joints], points) + self.place[joints])


@lru_cache(maxsize=8)
def joints_of(robot: Robot) -> tuple[JointGeometry, ...]:
    """Return the geometry of a robot's joints, in Pinocchio's order."""
    return tuple(joint_geometry(robot.model))


def joint_frames(robot: Robot, q: Array) -> JointFrames:
    """Return where the joints are at postures (n, N), rad or m in the robot's order."""
    samples, joints = q.shape[1], joints_of(robot)
    turn = np.zeros((len(joints) + 1, 3, 3, samples))
    place = np.zeros((len(joints) + 1, 3, samples))
    axis = np.zeros((robot.n, 3, samples))
    turn[0] = np.eye(3)[:, :, None]
    for k, joint in enumerate(joints, 1):
        own = place_of(robot, k)
        base = turn[joint.parent]
        place[k] = place[joint.parent] + np.einsum("abN,b->aN", base, joint.offset)
        turned = np.einsum("abN,bc->acN", base, joint.rotation)
        axis[own] = np.einsum("abN,b->aN", turned, joint.axis)
        if joint.prismatic:
            place[k] += axis[own] * q[own]
        else:
            turned = np.einsum("abN,bcN->acN", turned, rotation(joint.axis, q[own]))
        turn[k] = turned
    return JointFrames(turn, place, axis, place[1:][robot.order], robot.prismatic)
