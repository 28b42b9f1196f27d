"""The column of each joint's offset."""

from __future__ import annotations

from scara_ident.model.model import build_model
from scara_ident.model.offsets import offset_columns
from scara_ident.robot.robot import load_robot


def test_each_joint_has_its_own_but_one_that_goes_up_and_down(tmp_path):
    model = build_model(load_robot(), "complete")
    assert [model.names[column] for column in offset_columns(model)] == ["p_o1", "p_o2"]
