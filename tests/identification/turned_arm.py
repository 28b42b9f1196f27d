"""Four joints of a Kinova, two of whose zeros may count from elsewhere, for the tests of readings of the channels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scara_ident.estimation.observations import Observations, observe
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import prepare
from scara_ident.recording.recording import Recording
from scara_ident.robot.description import RobotDescription
from scara_ident.robot.robot import Robot, build_robot
from tests.arms import Array, example_urdf, noisy, recorded_torque, recording, sines

BANDS = (5.0,) * 4
FRICTION = ((0.2, 0.1, 0.0, 0.0, 0.05),) * 4


def arm(*numbers: int) -> Robot:
    """Return the arm with some of its joints, the others locked."""
    urdf = example_urdf("kinova.urdf")
    joints = dict.fromkeys(f"j2s6s200_joint_{k}" for k in numbers or (2, 3, 4, 5))
    return build_robot(RobotDescription(urdf=urdf, effort_side="joint", joints=joints), urdf)


def standing(robot: Robot, gravity: Sequence[float]) -> Robot:
    """Return the arm under other gravity."""
    model = robot.model.copy()
    model.gravity.linear = np.array(gravity)
    return replace(robot, model=model)


def runs(robot: Robot, quarters: Sequence[int], noise: float = 0.05, added: Array | None = None) -> list[Recording]:
    """Return recordings to whose positions quarter turns have to be added; ``added`` times each position is in the torque."""
    made = []
    for seed in (1, 2):
        rng, time = np.random.default_rng(seed), np.arange(1500) / 100.0
        q, v, a = sines(rng, time, robot.n)
        bounded = np.isfinite(robot.lower)
        q[bounded] += 0.5 * (robot.lower[bounded] + robot.upper[bounded])[:, None]
        q += rng.uniform(-1.0, 1.0, (robot.n, 1))
        torque = recorded_torque(robot, q, v, a, FRICTION[: robot.n])
        if added is not None:
            torque += added[:, None] * q
        seen = q - 0.5 * np.pi * np.array(quarters)[:, None]
        made.append(noisy(recording(robot, f"m{seed}_1", time, seen, torque), rng, noise))
    return made


def seen(robot: Robot, recordings: Sequence[Recording]) -> Observations:
    """Return what recordings say of the basic model."""
    return observe(build_model(robot, "basic"), prepare(recordings, BANDS[: robot.n]))
