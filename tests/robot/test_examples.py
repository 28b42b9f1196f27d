"""Robots of example-robot-data by their names."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError
from pathlib import Path

import numpy as np
import pytest

from scara_ident.errors import RobotError
from scara_ident.robot import examples
from scara_ident.robot.examples import example_robots, example_urdf, is_name
from scara_ident.robot.robot import load_robot


@pytest.mark.parametrize(
    ("name", "file", "joints"),
    [
        ("ur5", "ur5_robot.urdf", 6),
        ("UR10", "ur10_robot.urdf", 6),
        ("ur3", "ur3_robot.urdf", 6),
        # Its fingers are coupled, and so locked.
        ("panda", "panda.urdf", 7),
        ("xarm7", "xarm7.urdf", 7),
        ("asr_twodof", "TwoDofs.urdf", 2),
    ],
)
def test_a_robot_is_loaded_by_its_name(name: str, file: str, joints: int):
    robot = load_robot(name)
    assert (robot.urdf.name, robot.n, robot.effort_side) == (file, joints, "joint")
    assert np.all(robot.standard_parameters()[: 10 * joints : 10] > 0.0)


@pytest.mark.slow
def test_every_name_can_be_given_on_a_command_line():
    robots = example_robots()
    assert len(robots) > 50
    # What a caller does with them is the caller's.
    robots.pop("ur3")
    assert "ur3" in example_robots()
    assert all(path.is_file() for path in robots.values())
    assert all(example_urdf(name.upper()) == path for name, path in robots.items())
    # Also that with a point in it.
    assert all(is_name(Path(name)) for name in robots)


def test_an_unknown_name_is_answered_with_similar_ones():
    with pytest.raises(RobotError, match=r"^ur6: no such file, nor a robot of example-robot-data; did you mean .*ur5"):
        load_robot("ur6")
    with pytest.raises(RobotError, match=r"xyzzy: no such file, .*; it has .*panda, .*ur5"):
        load_robot("xyzzy")


def test_files_come_before_names_and_folders_of_results_do_not(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(tmp_path)
    assert is_name(Path("ur5"))
    assert not is_name(Path("arms/ur5"))
    assert not is_name(Path("ur5.yaml"))
    Path("ur5").mkdir()
    assert load_robot("ur5").n == 6
    Path("nothing").mkdir()
    with pytest.raises(RobotError, match="nothing: is a folder"):
        load_robot("nothing")
    Path("panda").write_text("urdf: nowhere.urdf\n")
    with pytest.raises(RobotError, match="nowhere"):
        load_robot("panda")


def test_a_robot_description_may_name_one_unless_a_file_of_that_name_lies_beside_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    (tmp_path / "robot.yaml").write_text("urdf: ur5\n")
    assert load_robot(tmp_path / "robot.yaml").urdf == load_robot("ur5").urdf.resolve()
    elsewhere = tmp_path / "elsewhere"
    (elsewhere / "ur5").mkdir(parents=True)
    monkeypatch.chdir(elsewhere)
    assert load_robot(tmp_path / "robot.yaml").urdf.name == "ur5_robot.urdf"
    (tmp_path / "ur5").write_text("no URDF")
    with pytest.raises(RobotError, match=f"{tmp_path}/ur5"):
        load_robot(tmp_path / "robot.yaml")


def test_without_the_package_it_is_said_what_to_install(monkeypatch: pytest.MonkeyPatch):
    def lost(name: str) -> None:
        raise PackageNotFoundError(name)

    monkeypatch.setattr(examples, "distribution", lost)
    monkeypatch.setattr(examples, "_robots", examples._robots.__wrapped__)
    with pytest.raises(RobotError, match="pip install example-robot-data"):
        load_robot("ur5")
