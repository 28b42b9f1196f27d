"""Small identifications for the tests of reports."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.identification.identify import Identification, identify
from scara_ident.motion.motion import Motion
from scara_ident.paper import OJD, table5_parameters
from scara_ident.recording.recording import Recording
from scara_ident.report.traces import Trace
from scara_ident.robot.robot import load_robot
from tests.arms import noisy, recorded_torque, recording

RATE = 250.0


def run(name: str, seed: int, still: bool = False, seconds: float = 12.0, start: float = 0.0) -> Recording:
    """A noisy run of OJD, with joint 2 at rest if wanted."""
    robot = load_robot()
    time = np.arange(round(seconds * RATE)) / RATE
    q, v, a = OJD.motion(time + start)
    if still:
        q[1], v[1], a[1] = 0.3, 0.0, 0.0
    truth = table5_parameters("OJD")
    friction = [(*truth[5 + 4 * j : 9 + 4 * j], 0.0) for j in range(2)]
    clean = recording(robot, name, time, q, recorded_torque(robot, q, v, a, friction))
    return noisy(clean, np.random.default_rng(seed), (0.02, 0.008))


def resting(name: str, seed: int) -> Recording:
    """A noisy run that stays near each turning point, so that part of it is at rest."""
    robot, time, omega = load_robot(), np.arange(3000) / RATE, np.array([[1.1], [1.7]])
    sine, cosine = np.sin(omega * time), np.cos(omega * time)
    q = -(cosine - 2.0 / 3.0 * cosine**3 + 0.2 * cosine**5)
    v, a = omega * sine**5, 5.0 * omega**2 * sine**4 * cosine
    clean = recording(robot, name, time, q, recorded_torque(robot, q, v, a, [(0.2, 0.05, 0.0, 0.0, 0.0)] * 2))
    return noisy(clean, np.random.default_rng(seed), (0.02, 0.008))


def made(fit: Sequence[Recording], held_out: Sequence[Recording] = (), **options) -> Identification:
    return identify(load_robot(), fit, validation=held_out, **{"bands": [15.0, None], **options})


def trace_of(motion: Motion, used: np.ndarray | None = None) -> Trace:
    """A trace whose torque is all residual."""
    zero, torque = np.zeros_like(motion.q), motion.torque
    used = np.ones(motion.q.shape, dtype=bool) if used is None else used
    return Trace("X", 0.0, motion, torque, zero, torque, zero, zero, zero, used, (1, 1), 1)


def swinging(torque: np.ndarray) -> Motion:
    """Two joints on sines of two frequencies."""
    time = np.arange(torque.shape[1]) / RATE
    omega = np.array([[0.7], [0.9]])
    q, v = np.sin(omega * time), omega * np.cos(omega * time)
    return Motion("X", "X", time, q, v, -(omega**2) * q, torque, RATE)
