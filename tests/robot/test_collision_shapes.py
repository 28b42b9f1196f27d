"""Collision shapes: a mesh stands for its convex hull."""

import numpy as np
import pinocchio as pin
import pytest
import trimesh

from scara_ident.errors import RobotError
from scara_ident.robot.collision_shapes import collision_shapes
from scara_ident.robot.robot import load_robot
from tests.arms import Link, write_urdf


def arm(folder, *shapes: str):
    return load_robot(write_urdf(folder / "arm.urdf", [Link(com=(0.0, 0.0, 0.0), shape=shape) for shape in shapes]))


def test_a_hollow_mesh_is_filled_and_measured(tmp_path):
    # Two cubes of 0.2 m, 0.4 m apart between their middles along x: the hull is a bar from -0.1 to 0.5.
    cubes = [trimesh.creation.box((0.2, 0.2, 0.2)), trimesh.creation.box((0.2, 0.2, 0.2))]
    cubes[1].apply_translation((0.4, 0.0, 0.0))
    trimesh.util.concatenate(cubes).export(tmp_path / "cubes.stl")
    robot = arm(tmp_path, '<mesh filename="cubes.stl" scale="1 1 2"/>', '<sphere radius="0.05"/>')
    shapes = collision_shapes(robot)
    assert [shape.parentJoint for shape in shapes.geometryObjects] == [1, 2]
    shapes.geometryObjects[1].placement = pin.SE3(np.eye(3), np.array([0.2, 0.5, 0.1]))
    shapes.addCollisionPair(pin.CollisionPair(0, 1))
    data, measured = robot.model.createData(), shapes.createData()
    pin.computeDistances(robot.model, data, shapes, measured, pin.neutral(robot.model))
    # Between the cubes, over the side of the bar.
    assert measured.distanceResults[0].min_distance == pytest.approx(0.5 - 0.1 - 0.05, abs=1e-6)


def test_meshes_that_cannot_be_used_are_one_line(tmp_path):
    with pytest.raises(RobotError, match=r"link l1: mesh gone\.stl is not found"):
        collision_shapes(arm(tmp_path, '<mesh filename="gone.stl"/>'))
    flat = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 3, 2]])
    flat.export(tmp_path / "flat.stl")
    with pytest.raises(RobotError, match=r"flat\.stl: the mesh has no volume"):
        collision_shapes(arm(tmp_path, '<mesh filename="flat.stl"/>'))
    (tmp_path / "bad.stl").write_bytes(b"solid nothing")
    with pytest.raises(RobotError, match="collision shapes cannot be read: Could not load"):
        collision_shapes(arm(tmp_path, '<mesh filename="bad.stl"/>'))
    with pytest.raises(RobotError, match="shape l1_0 has a negative size"):
        collision_shapes(arm(tmp_path, '<sphere radius="-1"/>'))
    assert collision_shapes(load_robot()).ngeoms == 0
