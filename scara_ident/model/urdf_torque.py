"""The torque of the URDF's bodies along a motion, with gravity's share by each direction that it may have."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from scara_ident.arrays import Array
from scara_ident.model.regressor.program import Program
from scara_ident.model.regressor.recursion import joint_geometry
from scara_ident.model.regressor.torque import trace_torque
from scara_ident.model.regressor.tracing import Trace, compile_program
from scara_ident.model.regressor.vectors import ZERO, floats
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import Robot

# Samples at a time: few enough for the cache.
CHUNK = 8192


def urdf_torques(robot: Robot, motion: Motion) -> Array:
    """Return what the URDF's bodies take, without rotors, on the side of the recorded effort.

    Parameters
    ----------
    robot : Robot
    motion : Motion

    Returns
    -------
    ndarray, shape (n, 4, N)
        Of inertia alone, then of gravity of 1 m/s^2 along each axis of the base.
    """
    n, program = robot.n, _program(robot)
    result = np.zeros((n, 4, motion.samples))
    buffers = np.empty((program.buffers, min(CHUNK, motion.samples)))
    for start in range(0, motion.samples, CHUNK):
        some = slice(start, start + CHUNK)
        states = [row[some] for part in (motion.q, motion.v, motion.a) for row in part]
        targets = [result[joint, kind, some] for kind in range(4) for joint in range(n)]
        program.evaluate(states, targets, buffers[:, : len(targets[0])])
    result *= robot.row_scale[:, None, None]
    return result


@lru_cache(maxsize=16)
def _program(robot: Robot) -> Program:
    trace, back = Trace(), np.argsort(robot.order)
    q, v, a = ([trace.variable(int(j) + part * robot.n) for j in back] for part in range(3))
    # The parameters stand in the order of the description, the bodies in Pinocchio's.
    bodies = robot.standard_parameters()[: 10 * robot.n].reshape(-1, 10)[back]
    joints, still = joint_geometry(robot.model), [0.0] * robot.n
    torques = [trace_torque(joints, ZERO, bodies, q, v, a)]
    torques += [trace_torque(joints, floats(axis), bodies, q, still, still) for axis in np.eye(3)]
    outputs = [
        (kind * robot.n + joint, torque[int(j)])
        for kind, torque in enumerate(torques)
        for joint, j in enumerate(robot.order)
    ]
    return compile_program(trace, outputs)
