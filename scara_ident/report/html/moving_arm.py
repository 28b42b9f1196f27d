"""The moving arm: in its plane where its points stay in one, else in space."""

from __future__ import annotations

import numpy as np

from scara_ident.arrays import Array
from scara_ident.motion.motion import Motion
from scara_ident.report.html.blocks import Arm
from scara_ident.robot.kinematics import farthest_point
from scara_ident.robot.robot import Robot

# Pictures of the arm per second, and at the most.
FRAME_RATE = 25.0
MAX_FRAMES = 750
# What is smaller against the motion is rounding.
ROUNDING = 1e-9


def moving_arm(robot: Robot, motion: Motion, name: str) -> Arm:
    """Return the arm's joints over time; in a coordinate plane where no point ever leaves one parallel to it.

    Parameters
    ----------
    name : str
        Unique on the page.
    """
    count = int(min(MAX_FRAMES, max(2, motion.time[-1] - motion.time[0]) * FRAME_RATE))
    places = np.linspace(0, motion.samples - 1, count).astype(int)
    points = joint_points(robot, motion.q[:, places])
    moved = np.ptp(points, axis=0).max(axis=0)
    spread = np.ptp(points.reshape(-1, 3), axis=0)
    # The axis along which least moves, and of several the one along which the arm is thinnest.
    axes = list(range(3))
    across = min(axes, key=lambda k: (moved[k] > ROUNDING * max(moved), spread[k]))
    if moved[across] <= ROUNDING * max(moved):
        axes.remove(across)
    period = float(motion.time[-1] - motion.time[0]) / (count - 1)
    return Arm(name, points[:, :, axes], period, tuple("xyz"[k] for k in axes))


def joint_points(robot: Robot, q: Array) -> Array:
    """Return where the base, the joints and the arm's end are.

    Parameters
    ----------
    q : ndarray, shape (n, N)
        In the robot's order, rad or m.

    Returns
    -------
    ndarray, shape (N, points, 3)
        m, in the base frame, from the base outwards.
    """
    import pinocchio as pin

    model = robot.model
    data = model.createData()
    last = model.njoints - 1
    end = farthest_point(robot)
    neutral, velocity = pin.neutral(model), np.zeros(model.nv)
    frames = []
    for column in q.T:
        velocity[robot.order] = column
        # From neutral, a displacement of the joints is their position, continuous joints included.
        pin.forwardKinematics(model, data, pin.integrate(model, neutral, velocity))
        points = [placement.translation.copy() for placement in data.oMi]
        frames.append([*points, data.oMi[last].act(end)])
    return np.array(frames)
