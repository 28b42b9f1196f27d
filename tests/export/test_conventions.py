"""What is said of directions and sides."""

from __future__ import annotations

from dataclasses import replace

from scara_ident.export.conventions import convention_lines
from tests.export.arms import branched, panda, scara, ur5


def test_directions_and_gravity_are_said_of_every_arm(tmp_path):
    lines = convention_lines(scara(tmp_path))
    assert "behind the gear" in lines[0] and "URDF" in lines[0]
    assert lines[1] == "A torque is what the drive must give: friction has the direction of the motion."
    assert lines[2] == "Gravity is 0, 0, -9.81 m/s^2 in the base frame."


def test_a_gear_that_reverses_and_locked_joints_are_said(tmp_path):
    robot = branched(tmp_path)
    (line,) = (line for line in convention_lines(robot) if "reverses" in line)
    assert "wrist" in line and "shoulder" not in line
    assert not any("reverses" in line for line in convention_lines(ur5(tmp_path)))
    # At the joint's side nothing is reversed.
    assert not any("reverses" in line for line in convention_lines(replace(robot, effort_side="joint")))


def test_where_locked_joints_stand_is_said(tmp_path):
    robot = panda(tmp_path)
    assert robot.locked
    (line,) = (line for line in convention_lines(robot) if line.startswith("Locked"))
    assert all(f"{name} at {place:g}" in line for name, place in robot.locked)
