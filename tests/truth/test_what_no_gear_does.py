"""What fits and cannot be: not believed, and what is left is not called noise."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.diagnosis.diagnose import diagnose
from scara_ident.robot.robot import load_robot
from tests.arms import noisy, recorded_torque, recording
from tests.diagnosis.made import NOISE, multisine
from tests.estimation.test_run_variation import TRUTH

pytestmark = pytest.mark.slow

FRICTION = [(*TRUTH[5 + 4 * j : 9 + 4 * j], 0.0) for j in range(2)]


def test_friction_that_falls_to_a_quarter_in_half_a_second_is_no_warm_up():
    """Commit a6cf3ca: `explained`, warm_up with share 3.29 +- 0.007 and time constant 0.601 +- 0.002 s."""
    robot = load_robot()
    time = np.arange(3000) / 250.0
    runs = []
    for k, name in enumerate("ABCD"):
        motion = multisine(name, 3 + k, 12.0).at(time)
        signals = (motion.position, motion.velocity, motion.acceleration)
        torque = recorded_torque(robot, *signals, FRICTION)
        alone = recorded_torque(robot, *signals, [(0.0,) * 5, FRICTION[1]])
        torque[0] += 3.3 * np.exp(-time / 0.6) * (torque - alone)[0]
        runs.append(
            noisy(recording(robot, f"{name}_1", time, motion.position, torque), np.random.default_rng(k), NOISE)
        )
    found = diagnose(robot, runs)
    assert not found.effects
    assert found.verdict in ("undecided", "unexplained")
    assert not found.evidence[0].shown
