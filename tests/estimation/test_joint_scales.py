"""The scale of each joint's effort beside the torque of the URDF's bodies, where that shows."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.estimation.joint_scales import joint_scales
from scara_ident.estimation.observations import Observations, observe
from scara_ident.model.model import build_model
from scara_ident.motion.prepared import prepare
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from tests.arms import recorded_torque, recording, sines

UR5 = load_robot("ur5")
RATE, SECONDS, NOISE = 200.0, 20.0, 0.05


def run(factors: np.ndarray, rotor: float = 0.0) -> Recording:
    """A motion whose efforts are the torque times a factor of each joint; every rotor has an inertia that no URDF states."""
    time = np.arange(round(SECONDS * RATE)) / RATE
    random = np.random.default_rng(4)
    q, v, a = sines(random, time, UR5.n)
    torque = recorded_torque(UR5, q, v, a, [(3.0, 1.0, 0.0, 0.0, 0.1)] * UR5.n) + rotor * a
    return recording(UR5, "M_1", time, q, factors[:, None] * (torque + NOISE * random.standard_normal(torque.shape)))


def observed(item: Recording) -> Observations:
    return observe(build_model(UR5, "basic"), prepare([item], (4.0,) * UR5.n))


def test_each_scale_is_the_effort_s_over_the_torque_of_the_bodies():
    factors = np.array([1.0, 0.1, -1.0, 30.0, 1.0, 1.0])
    found = joint_scales(observed(run(factors)))
    # Gravity shows on the shoulder, the elbow and the first wrist.
    assert {1, 2, 3} <= found.keys()
    for j in (1, 2, 3):
        assert found[j] == pytest.approx(factors[j], rel=0.01)


def test_a_rotor_that_nobody_stated_takes_nothing_from_the_scale():
    alone, geared = (joint_scales(observed(run(np.ones(6), rotor))) for rotor in (0.0, 2.0))
    assert {1, 2, 3} <= geared.keys()
    for j in (1, 2, 3):
        assert geared[j] == pytest.approx(alone[j], rel=0.01)


def test_what_only_friction_and_acceleration_explain_has_no_scale():
    item = run(np.ones(6))
    random = np.random.default_rng(5)
    noise = recording(UR5, "N_1", item.time, item.position, random.standard_normal(item.effort.shape))
    assert joint_scales(observed(noise)) == {}
