"""Recordings with a force on the tool for a while: exact for a position controller that the force does not move."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from scara_ident.recording.recording import Recording
from scara_ident.robot.kinematics import tool_frame
from scara_ident.robot.robot import Robot

Array = NDArray[np.float64]


def pushed(robot: Robot, run: Recording, force: Array, start: float, stop: float) -> Recording:
    """A run with a constant force on the tool, base frame, from start to stop: it takes ``J.T @ f`` from the drives' torque."""
    assert run.effort is not None
    frame = robot.model.getFrameId(tool_frame(robot).name, pin.FrameType.BODY)
    data, back = robot.model.createData(), np.argsort(robot.order)
    effort = run.effort.copy()
    for k in np.flatnonzero((run.time >= start) & (run.time <= stop)):
        full = pin.neutral(robot.model)
        for joint in list(robot.model.joints)[1:]:
            angle = run.position[back, k][joint.idx_v]
            full[joint.idx_q : joint.idx_q + joint.nq] = angle if joint.nq == 1 else (np.cos(angle), np.sin(angle))
        jacobian = pin.computeFrameJacobian(robot.model, data, full, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        effort[:, k] -= robot.row_scale * (jacobian[:3].T @ force)[robot.order]
    return replace(run, effort=effort)
