from __future__ import annotations

import numpy as np
import pytest

from scara_ident.errors import RobotError
from scara_ident.robot.robot import load_robot
from scara_ident.robot.visual_boxes import visual_boxes
from tests.estimation.consistent.arms import ur5, wrist_model

BOX = '<visual><origin xyz="0.1 0 0" rpy="0 0 1.5707963267948966"/><geometry><box size="0.4 0.2 0.1"/></geometry></visual>'
ROD = (
    '<visual><origin rpy="0 1.5707963267948966 0"/><geometry><cylinder radius="0.03" length="0.5"/></geometry></visual>'
)


def one_link(folder, visual):
    text = (
        '<robot name="r"><link name="base"/><link name="l"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" '
        f'iyy="1" iyz="0" izz="1"/></inertial>{visual}</link><joint name="j" type="revolute"><parent link="base"/>'
        '<child link="l"/><axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>'
    )
    path = folder / "one.urdf"
    path.write_text(text, encoding="utf-8")
    return load_robot(path)


def test_boxes_of_turned_shapes(tmp_path):
    ((low, high),) = visual_boxes(one_link(tmp_path, BOX))
    np.testing.assert_allclose([low, high], [[0.0, -0.2, -0.05], [0.2, 0.2, 0.05]], atol=1e-12)
    ((low, high),) = visual_boxes(one_link(tmp_path, ROD))
    np.testing.assert_allclose([low, high], [[-0.25, -0.03, -0.03], [0.25, 0.03, 0.03]], atol=1e-12)


def test_a_locked_link_is_part_of_the_body_that_carries_it():
    (_, _), (low, high) = visual_boxes(load_robot())
    # The quill of link3 reaches 0.27 m above its joint and 0.18 m below.
    assert low[2] == pytest.approx(-0.18)
    assert high[2] == pytest.approx(0.27)


def test_meshes_are_found_and_measured():
    boxes = visual_boxes(ur5())
    assert len(boxes) == 6
    forearm = boxes[2][1] - boxes[2][0]
    assert 0.3 < forearm.max() < 0.6


def test_what_has_no_shape_is_one_line(tmp_path):
    with pytest.raises(RobotError, match="link l1 has no visual shape"):
        visual_boxes(wrist_model(tmp_path).robot)
    mesh = '<visual><geometry><mesh filename="package://nowhere/l.stl"/></geometry></visual>'
    with pytest.raises(RobotError, match=r"mesh package://nowhere/l\.stl is not found"):
        visual_boxes(one_link(tmp_path, mesh))
    (tmp_path / "bad.stl").write_bytes(b"solid nothing")
    mesh = '<visual><geometry><mesh filename="bad.stl"/></geometry></visual>'
    with pytest.raises(RobotError, match=r"bad\.stl: "):
        visual_boxes(one_link(tmp_path, mesh))
