"""How far and how fast recordings reach, and what is said of motions that reach further."""

from __future__ import annotations

import json

import numpy as np
import pytest

from scara_ident.motion.prepared import prepare
from scara_ident.motion.recorded_range import RecordedRange, faster_than_recorded, range_of_entry, recorded_range
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot

ROBOT = load_robot()
KNOWN = RecordedRange(np.array([-1.0, 0.0]), np.array([1.0, 2.0]), np.array([1.5, 0.5]), np.array([3.0, 1.0]))


def swinging(amplitude: float) -> Recording:
    """Both joints swing once a second about half a radian, the second half as far."""
    time = np.arange(4000) / 500.0
    q = 0.5 + amplitude * np.array([[1.0], [0.5]]) * np.sin(2.0 * np.pi * time)
    return Recording(f"a{amplitude}", "swing", 1, ROBOT.joints, time, q, np.zeros_like(q))


def test_the_range_of_swings_is_that_of_their_closed_form() -> None:
    found = recorded_range(prepare([swinging(0.2), swinging(0.4)], (20.0, 20.0)))
    size = np.array([0.4, 0.2])
    assert found.lower == pytest.approx(0.5 - size, abs=1e-3)
    assert found.upper == pytest.approx(0.5 + size, abs=1e-3)
    assert found.speed == pytest.approx(2.0 * np.pi * size, rel=1e-2)
    assert found.acceleration == pytest.approx((2.0 * np.pi) ** 2 * size, rel=1e-2)


def test_a_range_comes_back_from_its_entry() -> None:
    again = range_of_entry(json.loads(json.dumps(KNOWN.entry(ROBOT))), ROBOT)
    for name in ("lower", "upper", "speed", "acceleration"):
        np.testing.assert_array_equal(getattr(again, name), getattr(KNOWN, name))


def test_only_joints_that_are_clearly_faster_are_named() -> None:
    assert faster_than_recorded(KNOWN, 1.05 * KNOWN.speed, ROBOT) == ""
    said = faster_than_recorded(KNOWN, np.array([1.5, 0.8]), ROBOT)
    assert said.endswith("friction is extrapolated: joint2 0.8 rad/s, recorded 0.5.")
    assert faster_than_recorded(None, np.array([9.0, 9.0]), ROBOT) == ""
