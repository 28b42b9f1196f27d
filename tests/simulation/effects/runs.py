"""Runs of the virtual SCARA03 under one effect."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from scara_ident.simulation import (
    Effect,
    SimulationResult,
    VirtualArm,
    simulate,
)
from tests.arms import rnea
from tests.simulation.made import left_over, scara, swing

Array = NDArray[np.float64]


def run(effect: Effect | None = None, arm: VirtualArm | None = None, duration: float = 3.0) -> SimulationResult:
    arm = scara() if arm is None else arm
    return simulate(arm, swing(arm.robot, duration), effects=[] if effect is None else [effect])


def load_at_motor(result: SimulationResult) -> Array:
    t = result.true
    return rnea(result.arm.robot, t.position, t.velocity, t.acceleration) * result.arm.robot.row_scale[:, None]


def assert_changes_by(effect: Effect, equation: Callable[[SimulationResult], Array]) -> None:
    """Find the equation of an effect in the torque of its joint, and nothing in that of the other."""
    result = run(effect)
    extra = left_over(result.arm, result.true)
    j = result.arm.robot.joint_index(effect.joint)
    expected = equation(result)
    moving = result.true.direction[j] != 0.0
    assert np.abs(expected[moving]).max() > 0.005
    np.testing.assert_allclose(extra[j, moving], expected[moving], atol=1e-10)
    assert np.nanmax(np.abs(extra[1 - j])) < 1e-10
