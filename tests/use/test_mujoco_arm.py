"""In MuJoCo the arm with its effects goes where the model's torque takes it."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.errors import ScaraIdentError
from scara_ident.motion.motion import Motion
from scara_ident.motion.prepared import prepare
from scara_ident.use.mujoco_arm import mujoco_arm
from scara_ident.use.rollout import rollout_errors
from tests.arms import recording
from tests.export.arms import scara
from tests.export.identified import identified

RATE = 500.0


def test_only_the_arm_with_the_effect_stays_by_the_recording(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("mujoco", reason="needs MuJoCo, from the extra 'test'")
    found = identified(scara(tmp_path), ("position_dependent_friction",))
    # Ten times as large as friction's share: reversals of Coulomb friction are missed a little by both.
    larger = np.ones(len(found.value))
    larger[len(found.before) :] = 10.0
    found = replace(found, value=larger * found.value)
    size, omega, phase = np.array([[0.8], [0.6]]), np.array([[2.0], [3.1]]), np.array([[0.2], [0.4]])
    time = np.arange(1000) / RATE
    angle = omega * time + phase
    signals = size * np.sin(angle), size * omega * np.cos(angle), -size * omega**2 * np.sin(angle)
    torque = found.torque(Motion("sine", "sine", time, *signals, None, RATE))
    (part,) = prepare([recording(found.robot, "sine_1", time, signals[0], torque)], (40.0, 40.0)).stretches
    horizons = (0.02, 0.1)
    with mujoco_arm(found) as free:
        own = rollout_errors(free, part, horizons)
    with mujoco_arm(found.without_effects()) as free:
        other = rollout_errors(free, part, horizons)
    assert own.shape == (2, 2)
    place = int(np.argmax(other[1]))
    assert own[1, place] < 0.3 * other[1, place]
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(ScaraIdentError, match="MuJoCo is not installed"), mujoco_arm(found):
        pass
