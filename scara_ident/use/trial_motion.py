"""A motion from pose to pose within an arm's limits, on which models are tried."""

from __future__ import annotations

import numpy as np

from scara_ident.errors import RobotError
from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.inverse_dynamics import inverse_dynamics
from scara_ident.simulation.laws import MotionLaw
from scara_ident.simulation.reference import ReferenceMotion

# Shares of the limits; half of the way that a joint without limits goes, rad or m.
RANGE_SHARE, SPEED_SHARE, EFFORT_SHARE = 0.6, 0.6, 0.7
FREE_RANGE = 1.5
FREE_SPEED, FREE_SLIDE_SPEED = 2.0, 0.4
# Peak speed of the quintic in lengths of the way per duration.
QUINTIC_PEAK = 1.875
POSES, PAUSE = 5, 0.2
SLOWER, ATTEMPTS = 0.8, 12
RATE = 1000.0


def trial_motion(arm: VirtualArm, seed: int = 0, *, poses: int = POSES) -> ReferenceMotion:
    """Return a motion through random poses and back, quintic between them, slow enough for the torque limits.

    Parameters
    ----------
    poses : int, optional
        How many it goes through.

    Raises
    ------
    RobotError
        If the arm's weight alone exceeds a torque limit.
    """
    robot, random = arm.robot, np.random.default_rng(seed)
    # A range from 0 to 0, as drawing programs write it where none was set, is none: the arm was identified by its motion.
    stated = robot.upper > robot.lower
    lower = np.where(stated & np.isfinite(robot.lower), robot.lower, -FREE_RANGE)
    upper = np.where(stated & np.isfinite(robot.upper), robot.upper, FREE_RANGE)
    middle, half = 0.5 * (lower + upper), np.minimum(0.5 * RANGE_SHARE * (upper - lower), FREE_RANGE)
    places = middle[:, None] + half[:, None] * random.uniform(-1.0, 1.0, (robot.n, poses))
    places = np.concatenate([places, places[:, :1]], axis=1)
    usual = np.where(robot.prismatic, FREE_SLIDE_SPEED, FREE_SPEED)
    speed = SPEED_SHARE * np.minimum(robot.velocity_limit, usual)
    limit = EFFORT_SHARE * robot.torque_limit
    for slower in SLOWER ** np.arange(ATTEMPTS):
        motion = _through(arm, places, slower * speed)
        some = slice(None, None, 20)
        torque = inverse_dynamics(
            arm, arm.bodies, motion.position[:, some], motion.velocity[:, some], motion.acceleration[:, some]
        )
        if np.all(np.abs(torque / arm.scale[:, None]) <= limit[:, None]):
            return motion
    raise RobotError(f"{robot.name}: its weight alone exceeds the torque limits; give a trajectory that it can hold")


def _through(arm: VirtualArm, poses: np.ndarray, speed: np.ndarray) -> ReferenceMotion:
    law, pieces = MotionLaw(), []
    for start, stop in zip(poses.T[:-1], poses.T[1:], strict=True):
        way = stop - start
        duration = float(np.max(QUINTIC_PEAK * np.abs(way) / speed))
        count = max(2, int(np.ceil(duration * RATE)))
        s, rate, change = law(np.arange(count) / RATE, count / RATE)
        pieces.append((start[:, None] + way[:, None] * s, way[:, None] * rate, way[:, None] * change))
        rest = round(PAUSE * RATE)
        pieces.append((np.repeat(stop[:, None], rest, 1), *(np.zeros((len(way), rest)),) * 2))
    q, v, a = (np.concatenate(parts, axis=1) for parts in zip(*pieces, strict=True))
    return ReferenceMotion("trial", arm.robot.joints, np.arange(q.shape[1]) / RATE, q, v, a)
