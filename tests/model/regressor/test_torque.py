"""Torques of known bodies as recorded arithmetic, against Pinocchio's inverse dynamics."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from scara_ident.model.base_parameters import standard_regressor
from scara_ident.model.regressor.recursion import joint_geometry
from scara_ident.model.regressor.torque import trace_torque
from scara_ident.model.regressor.tracing import Trace, compile_program
from scara_ident.model.regressor.vectors import floats
from scara_ident.robot.robot import Robot
from tests.export.arms import ARMS, random_motion, random_standard


@pytest.mark.parametrize("make", ARMS, ids=lambda make: make.__name__)
def test_torques_are_those_of_the_regressor(make: Callable[[Path], Robot], tmp_path: Path) -> None:
    robot = make(tmp_path)
    n, standard = robot.n, random_standard(robot, 3)
    standard[10 * n :] = 0.0
    trace, back = Trace(), np.argsort(robot.order)
    q, v, a = ([trace.variable(k + part * n) for k in range(n)] for part in range(3))
    bodies = standard[: 10 * n].reshape(n, 10)[back]
    torque = trace_torque(joint_geometry(robot.model), floats(robot.model.gravity.linear), bodies, q, v, a)
    program = compile_program(trace, list(enumerate(torque)))
    motion = random_motion(robot, 3)
    out = np.zeros((n, motion[0].shape[1]))
    program.evaluate(np.concatenate([part[back] for part in motion]), out, np.zeros((program.buffers, out.shape[1])))
    expected = np.einsum("jpn,p->jn", standard_regressor(robot, *motion), standard)
    np.testing.assert_allclose(out[robot.order], expected, rtol=0, atol=1e-13 * np.max(np.abs(expected)))


def test_what_is_multiplied_by_zero_is_not_traced(tmp_path: Path) -> None:
    robot = ARMS[0](tmp_path)
    joints, n = joint_geometry(robot.model), robot.n
    bodies, zero = np.zeros((n, 10)), [0.0] * n
    bodies[-1, 9] = 0.5
    trace = Trace()
    q, a = ([trace.variable(k + part * n) for k in range(n)] for part in (0, 2))
    torque = trace_torque(joints, floats(robot.model.gravity.linear), bodies, q, zero, a)
    program = compile_program(trace, list(enumerate(torque)))
    assert program.operations <= 3
    assert trace_torque(joints, floats(robot.model.gravity.linear), np.zeros((n, 10)), q, zero, a) == zero
