"""Cartesian paths: where the tool goes by Pinocchio's kinematics, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from scara_ident.errors import UsageError
from scara_ident.robot.robot import Robot, load_robot
from scara_ident.simulation.laws import MotionLaw
from scara_ident.simulation.paths import PathError, circle, line, tool_of
from tests.arms import Link, example_urdf, write_urdf

LENGTH = 0.33


def planar(q: np.ndarray) -> np.ndarray:
    return LENGTH * np.array([np.cos(q[0]) + np.cos(q[0] + q[1]), np.sin(q[0]) + np.sin(q[0] + q[1])])


def test_a_line_of_the_scara_is_straight_and_keeps_its_elbow() -> None:
    start, end = np.array([0.45, 0.1]), np.array([0.1, 0.4])
    for elbow in (1.5, -1.5):
        motion = line(load_robot(), start, end, 2.0, near=[0.5, elbow])
        tool = planar(motion.position)
        np.testing.assert_allclose(tool[:, [0, -1]].T, [start, end], atol=1e-8)
        across = np.array([-(end - start)[1], (end - start)[0]]) / np.linalg.norm(end - start)
        assert np.abs(across @ (tool - start[:, None])).max() < 1e-8
        assert np.all(np.sign(motion.position[1]) == np.sign(elbow))
        np.testing.assert_allclose(
            np.gradient(motion.position, motion.time, axis=1)[:, 1:-1], motion.velocity[:, 1:-1], atol=1e-4
        )
        np.testing.assert_allclose(
            np.gradient(motion.velocity, motion.time, axis=1)[:, 1:-1], motion.acceleration[:, 1:-1], atol=1e-3
        )


def test_a_circle_of_the_scara_has_its_radius() -> None:
    motion = circle(load_robot(), [0.2, 0.4], 0.12, 3.0, near=[0.4, 1.3], turns=-2.0, start_angle=0.4)
    arms = planar(motion.position) - np.array([[0.2], [0.4]])
    np.testing.assert_allclose(np.hypot(*arms), 0.12, atol=1e-8)
    angle = np.unwrap(np.arctan2(arms[1], arms[0]))
    assert angle[0] == pytest.approx(0.4)
    assert angle[-1] - angle[0] == pytest.approx(-4.0 * np.pi)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["ur5_robot.urdf", "panda.urdf"])
def test_a_six_axis_arm_holds_its_orientation_along_a_line(name: str) -> None:
    robot = load_robot(example_urdf(name))
    robot = robot if name.startswith("ur5") else without_fingers(robot)
    near = (
        np.array([0.2, -1.2, 1.4, -0.8, -1.2, 0.3]) if robot.n == 6 else np.array([0.2, 0.3, 0.1, -1.8, 0.2, 2.0, 0.4])
    )
    tool = tool_of(robot)
    place, turned, _ = tool.pose(near)
    end = place + np.array([0.1, -0.15, 0.08])
    motion = line(robot, place, end, 1.5, near=near, law=MotionLaw("trapezoidal"))
    for share in (0, 300, 700, 1100, 1500):
        reached, orientation, _ = tool.pose(motion.position[:, share])
        assert np.linalg.norm(pin.log3(orientation @ turned.T)) < 1e-7
        s = motion_share(share / 1000.0, 1.5)
        np.testing.assert_allclose(reached, place + s * (end - place), atol=1e-7)


def motion_share(time: float, duration: float) -> float:
    return float(MotionLaw("trapezoidal")(np.array([time]), duration)[0][0])


def without_fingers(robot: Robot) -> Robot:
    from scara_ident.robot.description import RobotDescription
    from scara_ident.robot.robot import build_robot

    joints = {name: None for name in robot.joints if "finger" not in name}
    return build_robot(RobotDescription(urdf=robot.urdf, joints=joints, effort_side="joint"), Path("robot.yaml"))


def test_a_sliding_axis_takes_part(tmp_path: Path) -> None:
    links = [Link(), Link(kind="prismatic", axis=(1.0, 0.0, 0.0), xyz=(0.2, 0.0, 0.0))]
    robot = load_robot(write_urdf(tmp_path / "rp.urdf", links))
    motion = line(robot, [0.5, 0.1], [0.3, 0.4], 1.0, near=[0.2, 0.2], tool=np.array([0.1, 0.0, 0.0]))
    radius = 0.3 + motion.position[1]
    np.testing.assert_allclose(radius[-1], 0.5, atol=1e-8)
    np.testing.assert_allclose(motion.position[0, -1], np.arctan2(0.4, 0.3), atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("start", "end", "said"),
    [
        ([0.4, 0.2], [0.9, 0.3], "outside the reach"),
        ([0.8, 0.1], [0.3, 0.3], r"\(0.800, 0.100, 0.420\) m, 0 % of the way is outside the reach"),
        ([0.4, 0.2], [0.66, 0.0], "singular"),
        ([0.3, 0.3], [-0.3, -0.3], "singular|outside its range"),
        ([0.2, -0.3], [-0.25, -0.3], "joint1 would be at|outside its range"),
    ],
)
def test_what_the_arm_cannot_follow_is_one_line(start: list[float], end: list[float], said: str) -> None:
    with pytest.raises(PathError, match=said) as caught:
        line(load_robot(), start, end, 1.0, near=[0.2, 1.2])
    assert "\n" not in str(caught.value)
    assert caught.value.point.shape == (3,)


def test_arguments_without_sense_are_refused() -> None:
    robot = load_robot()
    with pytest.raises(UsageError, match="near has 3 positions; scara03 has 2 joints"):
        line(robot, [0.4, 0.1], [0.3, 0.3], 1.0, near=[0, 0, 0])
    with pytest.raises(UsageError, match="expected x, y or x, y, z"):
        line(robot, [0.4], [0.3, 0.3], 1.0, near=[0, 1])
    with pytest.raises(UsageError, match="radius"):
        circle(robot, [0.4, 0.1], 0.0, 1.0, near=[0, 1])
    with pytest.raises(UsageError, match="quintic or trapezoidal"):
        MotionLaw("cubic")  # type: ignore[arg-type]
    with pytest.raises(UsageError, match="acceleration_share"):
        MotionLaw("trapezoidal", 0.7)
    with pytest.raises(UsageError, match="passes"):
        MotionLaw(passes=0)
    with pytest.raises(UsageError, match="rest_share"):
        MotionLaw(rest_share=1.0)
