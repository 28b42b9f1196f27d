"""Small identifications for the tests of reports."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.identification.identify import Identification, identify
from scara_ident.paper import OJD, table5_parameters
from scara_ident.recording.recording import Recording
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


def made(fit: Sequence[Recording], held_out: Sequence[Recording] = (), **options) -> Identification:
    return identify(load_robot(), fit, validation=held_out, **{"bands": [15.0, None], **options})
