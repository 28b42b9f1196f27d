"""The momentum's rate less what changes it is the torque of the rigid bodies."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.export.identified_model import IdentifiedModel
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot
from scara_ident.use.momentum import arm_momentum
from tests.arms import motion, ur5
from tests.simulation.made import tree
from tests.use.made import known_as

STEP = 1e-5


@pytest.mark.parametrize("name", ["scara03", "ur5", "tree"])
def test_it_is_that_of_the_model(name: str, tmp_path: Path):
    robot = {"scara03": load_robot, "ur5": ur5, "tree": lambda: tree(tmp_path)}[name]()
    model = build_model(robot, "basic")
    body, rng = model.rigid_body, np.random.default_rng(1)
    value = np.zeros(len(model.columns))
    # Not the URDF's: as an identification finds them.
    value[model.place(body)] = (body.base.grouping @ robot.standard_parameters())[body.kept] + 0.05 * rng.normal(size=len(body.columns))  # fmt: skip
    arm = arm_momentum(known_as(model, value))
    q, v, a = rng.normal(size=(3, robot.n))
    after, before = (arm.at(q + h * v + 0.5 * h * h * a, v + h * a)[0] for h in (STEP, -STEP))
    torque = (after - before) / (2.0 * STEP) - arm.at(q, v)[1]
    state = motion(q[:, None], v[:, None], a[:, None])
    expected = body.torque(state, value[model.place(body)])[:, 0] / robot.row_scale
    np.testing.assert_allclose(torque, expected, rtol=0.0, atol=1e-7 * np.abs(expected).max())


def test_a_body_without_mass_is_no_obstacle(known: IdentifiedModel):
    arm = arm_momentum(replace(known, value=np.where(np.arange(len(known.value)) < 3, 0.0, known.value)))
    assert np.all(np.isfinite(arm.at(np.ones(2), np.ones(2))))
