"""Joints that follow another are locked with it, and never identified."""

from __future__ import annotations

from pathlib import Path

import pytest

from scara_ident.errors import RobotError
from scara_ident.robot.robot import load_robot
from tests.arms import Link, write_urdf


def coupled(
    folder: Path, *mimics: tuple[int, str], joints: str = "", parents: tuple[int, ...] = (-1, -1, 1, 1)
) -> Path:
    """Write an arm of two joints and two fingers, of which some follow others, and its description."""
    path = write_urdf(folder / "arm.urdf", [Link(parent=parent) for parent in parents])
    text = path.read_text()
    for number, mimic in mimics:
        head, tail = text.split(f'<joint name="j{number}" type="revolute">')
        text = f'{head}<joint name="j{number}" type="revolute"><mimic {mimic}/>{tail}'
    path.write_text(text)
    (folder / "robot.yaml").write_text(f"urdf: arm.urdf\n{joints}")
    return folder / "robot.yaml"


def test_a_gripper_is_locked_where_its_master_stands(tmp_path: Path):
    robot = load_robot(coupled(tmp_path, (4, 'joint="j3" multiplier="-2" offset="0.1"'), joints="locked: {j3: 0.2}\n"))
    assert robot.joints == ("j1", "j2")
    assert dict(robot.locked) == {"j3": 0.2, "j4": pytest.approx(-0.3)}
    assert robot.notes == ("j3, j4: coupled (mimic) and carry no other joint: they are locked",)


def test_a_chain_of_followers_follows_its_first(tmp_path: Path):
    mimics = ((4, 'joint="j3" multiplier="2"'), (3, 'joint="j2" offset="0.5"'))
    robot = load_robot(coupled(tmp_path, *mimics, joints="joints: {j1: {}}\nlocked: {j2: 0.1}\n"))
    assert dict(robot.locked) == {"j2": 0.1, "j3": pytest.approx(0.6), "j4": pytest.approx(1.2)}
    assert robot.notes == ()


@pytest.mark.parametrize(
    ("mimic", "joints", "said"),
    [
        ((4, 'joint="j3"'), "joints: {j1: {}, j4: {}}", "joints.j4: follows j3 .*; leave it out"),
        ((4, 'joint="j3"'), "joints: {j1: {}, j3: {}}", "joints.j3: j4 follows it .*; leave it out"),
        # A parallel linkage: the second joint carries others.
        ((3, 'joint="j2"'), "", "joints.j2: j3 follows it"),
    ],
)
def test_what_cannot_be_coupled_is_refused_in_a_line(tmp_path: Path, mimic, joints, said):
    with pytest.raises(RobotError, match=said):
        load_robot(coupled(tmp_path, mimic, joints=f"{joints}\n"))
