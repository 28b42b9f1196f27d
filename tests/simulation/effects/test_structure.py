"""Tilt and payload against Pinocchio."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

from scara_ident.simulation import (
    VirtualArm,
)
from scara_ident.simulation import effects as fx
from tests.simulation.effects.runs import Array, run
from tests.simulation.made import left_over


def with_gravity(arm: VirtualArm, extra: Array) -> VirtualArm:
    model = pin.Model(arm.robot.model)
    model.gravity.linear = model.gravity.linear + extra
    return replace(arm, robot=replace(arm.robot, model=model))


def test_base_tilt_is_gravity_along_the_base() -> None:
    result = run(fx.BaseTilt(tilt_x=0.03, tilt_y=-0.02))
    tilted = with_gravity(result.arm, -9.81 * np.array([0.03, -0.02, 0.0]))
    assert np.nanmax(np.abs(left_over(result.arm, result.true))) > 0.01
    assert np.nanmax(np.abs(left_over(tilted, result.true))) < 1e-10


def test_payload_acts_from_its_time_on() -> None:
    result = run(fx.PayloadChange(mass=4.0, time=1.5))
    model = pin.Model(result.arm.robot.model)
    point = np.array([0.33, 0.0, 0.0])
    model.inertias[2] = model.inertias[2] + pin.Inertia(4.0, point, np.zeros((3, 3)))
    loaded = replace(result.arm, robot=replace(result.arm.robot, model=model))
    late = result.recording.time >= 1.5
    for arm, part in ((result.arm, ~late), (loaded, late)):
        assert np.nanmax(np.abs(left_over(arm, result.true)[:, part])) < 1e-10
    assert np.nanmax(np.abs(left_over(result.arm, result.true)[:, late])) > 0.01
