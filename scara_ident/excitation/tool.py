"""A point that the last joint carries: its position, velocity and acceleration, and how they follow the joints."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from scara_ident.arrays import Array
from scara_ident.model.regressor.recursion import JointGeometry, joint_geometry
from scara_ident.robot.kinematics import place_of, tool_frame
from scara_ident.robot.robot import Robot

IDENTITY = np.eye(3)[:, :, None]


@dataclass(frozen=True, eq=False)
class Tool:
    """A point of the arm with the joints that move it.

    Attributes
    ----------
    name : str
        Frame of the URDF.
    chain : tuple of (int, JointGeometry)
        From the base outwards: place of the joint in ``robot.joints``, and the joint.
    point : ndarray, shape (3,)
        In the frame of the last of these joints, m.
    joints : int
        Number n of joints of the robot.
    """

    name: str
    chain: tuple[tuple[int, JointGeometry], ...]
    point: Array
    joints: int


@dataclass(frozen=True, eq=False)
class ToolMotion:
    """Motion of the tool over N samples, in the base frame.

    Attributes
    ----------
    position, velocity, acceleration : ndarray, shape (3, N)
        m, m/s, m/s^2; acceleration without gravity.
    parts : tuple of (int, bool, tuple of ndarray)
        Of each joint that moves it: its place in ``robot.joints``, whether it slides, and its axis with two derivatives
        in time or, of one that turns, that and the way from the joint to the point with two derivatives, each (3, N).
    joints : int
        Number n of joints of the robot.
    moves : bool
        Whether it does not rest at every sample.
    """

    position: Array
    velocity: Array
    acceleration: Array
    parts: tuple[tuple[int, bool, tuple[Array, ...]], ...]
    joints: int
    moves: bool

    @cached_property
    def jacobians(self) -> Array:
        """What a unit rate of each joint gives to the point, and its first two derivatives in time, shape (3, n, 3, N).

        For a point that depends on q(t) alone, the derivative of its acceleration by q_j is the second derivative in
        time of its derivative by q_j, and that by q_j' is twice the first.
        """
        found = np.zeros((3, self.joints, *self.position.shape))
        for place, slides, (axis, rate, change, *arms) in self.parts:
            if slides:
                found[:, place] = axis, rate, change
                continue
            r, dr, ddr = arms
            found[0, place] = _cross(axis, r)
            if not self.moves:
                continue
            found[1, place] = _cross(rate, r) + _cross(axis, dr)
            found[2, place] = _cross(change, r) + 2.0 * _cross(rate, dr) + _cross(axis, ddr)
        return found


def tool_of(robot: Robot, frame: str | None = None) -> Tool:
    """Find a point to watch.

    Parameters
    ----------
    frame : str, optional
        A frame (link) of the URDF; without it the one that is farthest out on the last joint: 0.33 m along the
        second link of the SCARA03.

    Raises
    ------
    RobotError
        If the URDF has no such frame, or no joint moves it.
    """
    found = tool_frame(robot, frame)
    geometry = joint_geometry(robot.model)
    chain = []
    index = int(found.parentJoint)
    while index > 0:
        joint = geometry[index - 1]
        chain.append((place_of(robot, index), joint))
        index = joint.parent
    return Tool(found.name, tuple(reversed(chain)), np.array(found.placement.translation), robot.n)


def tool_motion(tool: Tool, q: Array, v: Array | None = None, a: Array | None = None) -> ToolMotion:
    """Return the motion of a tool; without velocities and accelerations it rests at every sample, which is quicker.

    Parameters
    ----------
    q, v, a : ndarray, shape (n, N)
        In the order of ``robot.joints``.
    """
    samples, moves = q.shape[1], v is not None and a is not None
    turn = np.broadcast_to(np.eye(3)[:, :, None], (3, 3, samples))
    origin, speed, push, spin, twist = (np.zeros((3, samples)) for _ in range(5))
    # Per joint: its axis with two derivatives, and the point it turns about with two derivatives.
    axes, centres = [], []
    for place, joint in tool.chain:
        arm = np.einsum("abN,b->aN", turn, joint.offset)
        origin = origin + arm
        turn = np.einsum("abN,bc->acN", turn, joint.rotation)
        axis = np.einsum("abN,b->aN", turn, joint.axis)
        rate = change = spin
        if moves:
            swing, rate = _cross(spin, arm), _cross(spin, axis)
            push = push + _cross(twist, arm) + _cross(spin, swing)
            speed = speed + swing
            change = _cross(twist, axis) + _cross(spin, rate)
        axes.append((axis, rate, change))
        x = q[place]
        if joint.prismatic:
            origin = origin + axis * x
        else:
            turn = np.einsum("abN,bcN->acN", turn, rotation(joint.axis, x))
        if v is not None and a is not None:
            dx, ddx = v[place], a[place]
            if joint.prismatic:
                push = push + axis * ddx + 2.0 * rate * dx + change * x
                speed = speed + axis * dx + rate * x
            else:
                twist = twist + axis * ddx + rate * dx
                spin = spin + axis * dx
        centres.append((origin, speed, push))
    arm = np.einsum("abN,b->aN", turn, tool.point)
    position, velocity, acceleration = origin + arm, speed, push
    if moves:
        swing = _cross(spin, arm)
        velocity, acceleration = speed + swing, push + _cross(twist, arm) + _cross(spin, swing)
    parts = []
    for (place, joint), axis, (centre, moved, pushed) in zip(tool.chain, axes, centres, strict=True):
        arms = () if joint.prismatic else (position - centre, velocity - moved, acceleration - pushed)
        parts.append((place, joint.prismatic, (*axis, *arms)))
    return ToolMotion(position, velocity, acceleration, tuple(parts), tool.joints, moves)


def _cross(x: Array, y: Array) -> Array:
    found = np.empty_like(y)
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        np.subtract(x[i] * y[j], x[j] * y[i], out=found[k])
    return found


def rotation(axis: Array, angle: Array) -> Array:
    """Return rotations about an axis, shape (3, 3, N), by Rodrigues' formula."""
    x, y, z = axis
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    first, second = skew[:, :, None], (skew @ skew)[:, :, None]
    return np.asarray(IDENTITY + np.sin(angle) * first + (1.0 - np.cos(angle)) * second)
