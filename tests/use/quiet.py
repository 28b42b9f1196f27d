"""Recordings of a UR5 without the virtual arm's loop: its rigid bodies and friction by Pinocchio, noise, and pushes J^T f."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

from scara_ident.export.identified_model import IdentifiedModel
from scara_ident.model.model import build_model
from scara_ident.recording.recording import Recording
from scara_ident.robot.kinematics import tool_frame
from tests.arms import recorded_torque, recording, sines, ur5
from tests.use.made import known_as

RATE, NOISE = 100.0, 0.5
FRICTION = [(2.0, 1.0, 0.0, 0.0, 0.1)] * 6


def known_ur5() -> IdentifiedModel:
    """The model of these recordings, a little wrong, as if it had been identified."""
    robot = ur5()
    model = build_model(robot, "complete")
    body = model.rigid_body
    value = np.concatenate([(body.base.grouping @ robot.standard_parameters())[body.kept], np.zeros(24 + 6)])
    friction = value[len(body.columns) : len(body.columns) + 24].reshape(6, 4)
    friction[:, 0], friction[:, 1] = 1.95, 1.03
    value[-6:] = 0.1
    return known_as(model, value, bands=(10.0,) * 6, rms=np.full(6, 0.5))


def quiet(seed: int, seconds: float = 20.0) -> Recording:
    """A run without contact, with recorded velocity."""
    robot, rng = ur5(), np.random.default_rng(seed)
    time = np.arange(round(seconds * RATE)) / RATE
    q, v, a = sines(rng, time, robot.n, size=0.5)
    torque = recorded_torque(robot, q, v, a, FRICTION) + NOISE * rng.standard_normal(q.shape)
    return recording(robot, f"quiet{seed}", time, q, torque, velocity=v)


def stopping(seed: int, seconds: float = 20.0) -> Recording:
    """A run that stands still for half of every four seconds, each joint held by any friction up to its Coulomb friction."""
    robot, rng = ur5(), np.random.default_rng(seed)
    time = np.arange(round(seconds * RATE)) / RATE
    pace = np.maximum(0.0, np.sin(0.5 * np.pi * time)) ** 2
    passed = np.cumsum(pace) / RATE
    q, v, a = sines(rng, passed, robot.n, size=0.5)
    a, v = a * pace**2 + v * np.gradient(pace, time), v * pace
    rest = pace == 0.0
    held = rng.uniform(-FRICTION[0][0], FRICTION[0][0], (robot.n, round(seconds / 4.0) + 1))
    friction = np.where(rest, held[:, (time / 4.0).astype(int)], 0.0)
    torque = recorded_torque(robot, q, v, a, FRICTION) + friction + 0.1 * NOISE * rng.standard_normal(q.shape)
    return recording(robot, f"stopping{seed}", time, q, torque, velocity=v)


def moved_from(run: Recording, pose: np.ndarray, size: float) -> Recording:
    """The same motion, so much smaller and about another pose, with velocities but without friction's error."""
    robot = ur5()
    q = pose[:, None] + size * run.position
    v, a = size * run.velocity, size * np.gradient(run.velocity, run.time, axis=1)
    noise = NOISE * np.random.default_rng(0).standard_normal(q.shape)
    return recording(robot, run.name, run.time, q, recorded_torque(robot, q, v, a, FRICTION) + noise, velocity=v)


def pushed(
    item: Recording, force: np.ndarray, start: float, stop: float, joints: int = 6, beside: np.ndarray | None = None
) -> Recording:
    """Return a run with a force on the tool, or beside it in the tool's frame, or the like on the first joints only."""
    robot = ur5()
    frame, data = robot.model.getFrameId(tool_frame(robot).name, pin.FrameType.BODY), robot.model.createData()
    effort = item.effort.copy()
    for k in np.flatnonzero((item.time >= start) & (item.time <= stop)):
        q = item.position[np.argsort(robot.order), k]
        jacobian = pin.computeFrameJacobian(robot.model, data, q, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        lever = np.zeros(3) if beside is None else data.oMf[frame].rotation @ beside
        load = jacobian.T @ np.concatenate([force, np.cross(lever, force)])
        effort[:joints, k] -= load[robot.order][:joints]
    return replace(item, effort=effort, name="pushed")
