"""A constant force on the tool: columns against the tool's Jacobian."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scara_ident.effects import Member
from scara_ident.effects.tool_force import ToolForce
from scara_ident.model.regressor.kernel import configurations
from scara_ident.robot.kinematics import force_torques
from scara_ident.robot.robot import load_robot
from tests.arms import CYLINDRICAL, example_urdf, write_urdf
from tests.effects.scenes import columns, moving, scene_of
from tests.simulation.made import tree


@pytest.mark.parametrize("name", ["scara03", "ur5", "tree", "cylindrical"])
def test_the_drives_hold_what_pulls_at_the_tool_by_its_jacobian(name: str, tmp_path: Path):
    """Of a reduction and of joints that slide too; in the order of the robot's joints."""
    robot = (
        tree(tmp_path) if name == "tree"
        else load_robot(write_urdf(tmp_path / "arm.urdf", CYLINDRICAL)) if name == "cylindrical"
        else load_robot(None if name == "scara03" else example_urdf("ur5_robot.urdf"))
    )  # fmt: skip
    item, scene = moving(robot, 0.5), scene_of(robot)
    found = columns(ToolForce(), scene, item, Member(None))
    states = configurations(robot.model, item.q[np.argsort(robot.order)]).T
    expected = -np.array(list(force_torques(robot, states)))
    assert np.moveaxis(found, -1, 0) == pytest.approx(expected, abs=1e-12 * np.abs(expected).max())
    assert [column.unit for column in ToolForce().columns(scene, Member(None))] == ["N"] * 3
    assert ToolForce().members(scene) == (Member(None),)
