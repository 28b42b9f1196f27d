"""The robot: what it takes from URDF and robot.yaml, and what it refuses in one line."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from scara_ident.errors import RobotError
from scara_ident.excitation import limits_of
from scara_ident.robot.robot import Robot, embedded_urdf, load_robot
from scara_ident.use.joint_limits import joint_limits
from tests.arms import PLANAR_2R, Link, example_urdf, rnea, write_urdf

TREE = (
    Link(axis=(0, 0, 1)),
    Link(axis=(0, 1, 0), xyz=(0.3, 0, 0.1), kind="prismatic"),
    Link(axis=(1, 0, 0), xyz=(0, 0.2, 0), rpy=(0.3, 0.2, 0.1), kind="continuous", parent=0),
    Link(axis=(0, 0.6, 0.8), xyz=(0.1, 0, 0)),
)


def described(folder: Path, text: str, links: tuple[Link, ...] = PLANAR_2R, reductions: tuple[float, ...] = ()) -> Path:
    write_urdf(folder / "arm.urdf", links, reductions)
    path = folder / "robot.yaml"
    path.write_text(f"urdf: arm.urdf\n{text}", encoding="utf-8")
    return path


def refusal(path: Path) -> str:
    with pytest.raises(RobotError) as caught:
        load_robot(path)
    message = str(caught.value)
    assert "\n" not in message
    return message


def state(robot: Robot, seed: int = 0) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    return [rng.uniform(-1, 1, (robot.n, 4)) for _ in range(3)]


def test_the_embedded_scara03_is_the_default():
    robot = load_robot()
    assert (robot.name, robot.joints, robot.links, robot.effort_side) == (
        "scara03",
        ("joint1", "joint2"),
        ("link1", "link2"),
        "motor",
    )
    assert robot.locked == (("joint3", 0.0),)
    np.testing.assert_array_equal(robot.reduction, [100.0, 100.0])
    np.testing.assert_array_equal(robot.rotor_inertia, [0.0014, 4.014e-4])
    np.testing.assert_allclose(np.rad2deg([robot.lower, robot.upper]), [[-35, -125], [215, 125]])
    np.testing.assert_array_equal(robot.velocity_limit, [3.77, 3.77])
    np.testing.assert_allclose(robot.torque_limit, [2.0, 2.0])
    np.testing.assert_array_equal(robot.model.gravity.linear, [0, 0, -9.81])
    assert robot.model.nv == robot.n == 2


def test_a_urdf_by_itself_gives_all_movable_joints_with_effort_at_the_joints(tmp_path: Path):
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", TREE))
    assert robot.joints == ("j1", "j2", "j3", "j4")
    assert robot.effort_side == "joint"
    assert robot.prismatic.tolist() == [False, True, False, False]
    assert robot.locked == ()


def test_a_urdf_by_itself_means_effort_at_the_joints_also_with_reductions(tmp_path: Path):
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R, (50.0, -80.0)))
    assert robot.effort_side == "joint"
    np.testing.assert_array_equal(robot.reduction, [50.0, -80.0])
    np.testing.assert_array_equal(robot.row_scale, [1.0, 1.0])


def test_limits_come_from_the_urdf_and_a_continuous_joint_has_none(tmp_path: Path):
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", TREE))
    np.testing.assert_array_equal(robot.lower, [-3, -3, -np.inf, -3])
    np.testing.assert_array_equal(robot.upper, [3, 3, np.inf, 3])
    np.testing.assert_array_equal(robot.velocity_limit, [4, 4, 4, 4])
    np.testing.assert_array_equal(robot.effort_limit, [50, 50, 50, 50])


@pytest.mark.parametrize(
    "urdf", ["ur5_robot.urdf", "panda.urdf", "allegro_right_hand.urdf", "double_pendulum_continuous.urdf"]
)
def test_arms_of_example_robot_data_load(urdf: str):
    robot = load_robot(example_urdf(urdf))
    full = pin.buildModelFromUrdf(str(example_urdf(urdf)))
    # In the order of the file, which is not always Pinocchio's; coupled fingers are locked.
    assert sorted((*robot.joints, *(name for name, _ in robot.locked))) == sorted(full.names[1:])
    assert [full.joints[full.getJointId(joint)].idx_v for joint in robot.joints] == robot.order.tolist()
    assert robot.model.nv == robot.n == full.nv - len(robot.locked)
    assert sorted(robot.order) == list(range(robot.n))


def test_locked_joints_at_given_positions_are_pinocchios_reduced_model(tmp_path: Path):
    path = described(tmp_path, "joints: {j4: {}, j1: {}}\nlocked: {j2: 0.15, j3: -0.8}\n", TREE)
    robot = load_robot(path)
    assert dict(robot.locked) == {"j2": 0.15, "j3": -0.8}
    full = pin.buildModelFromUrdf(str(tmp_path / "arm.urdf"))
    # Angle -0.8 of the continuous joint stands as cosine and sine.
    reference = pin.neutral(full)
    reference[full.joints[full.getJointId("j2")].idx_q] = 0.15
    place = full.joints[full.getJointId("j3")].idx_q
    reference[place : place + 2] = np.cos(-0.8), np.sin(-0.8)
    expected = pin.buildReducedModel(full, [full.getJointId("j2"), full.getJointId("j3")], reference)
    q, v, a = state(robot)
    for k in range(4):
        # Pinocchio's order is j1, j4; the robot's is j4, j1.
        torque = pin.rnea(expected, expected.createData(), q[::-1, k], v[::-1, k], a[::-1, k])
        np.testing.assert_allclose(rnea(robot, q, v, a)[:, k], torque[::-1], rtol=1e-12)


def test_where_a_joint_is_locked_matters(tmp_path: Path):
    torques = []
    for angle in (0.0, 1.0):
        robot = load_robot(described(tmp_path, f"joints: {{j1: {{}}}}\nlocked: {{j2: {angle}}}\n"))
        torques.append(rnea(robot, *state(robot)))
    assert np.max(np.abs(torques[0] - torques[1])) > 0.1


def test_joints_left_out_are_locked_at_zero(tmp_path: Path):
    robot = load_robot(described(tmp_path, "joints: {j1: {}}\n"))
    assert robot.locked == (("j2", 0.0),)
    assert robot.model.nv == 1


def test_joints_may_be_locked_without_a_list_of_the_others(tmp_path: Path):
    assert load_robot(described(tmp_path, "locked: {j1: 0.5}\n")).joints == ("j2",)


def test_gravity_is_that_of_the_description(tmp_path: Path):
    robot = load_robot(described(tmp_path, "gravity: [0, 0, 0]\n"))
    at_rest = [np.zeros((2, 1))] * 2
    np.testing.assert_array_equal(rnea(robot, np.ones((2, 1)), *at_rest), np.zeros((2, 1)))
    moon = load_robot(described(tmp_path, "gravity: [0, 0, -1.62]\n"))
    earth = load_robot(described(tmp_path, ""))
    on_moon, on_earth = (rnea(arm, np.ones((2, 1)), *at_rest) for arm in (moon, earth))
    np.testing.assert_allclose(on_moon / on_earth, 1.62 / 9.81, rtol=1e-12)


def test_the_order_of_the_joints_is_that_of_the_description(tmp_path: Path):
    straight = load_robot(described(tmp_path, "joints: {j1: {}, j2: {}, j3: {}, j4: {}}\n", TREE))
    mixed = load_robot(described(tmp_path, "joints: {j3: {}, j1: {}, j4: {}, j2: {}}\n", TREE))
    place = [2, 0, 3, 1]
    assert mixed.joints == tuple(straight.joints[k] for k in place)
    assert mixed.links == tuple(straight.links[k] for k in place)
    for name in ("prismatic", "lower", "upper", "order"):
        np.testing.assert_array_equal(getattr(mixed, name), getattr(straight, name)[place])
    q, v, a = state(straight)
    np.testing.assert_allclose(rnea(mixed, q[place], v[place], a[place]), rnea(straight, q, v, a)[place], rtol=1e-12)
    bodies = straight.standard_parameters()[:40].reshape(4, 10)
    np.testing.assert_array_equal(mixed.standard_parameters()[:40].reshape(4, 10), bodies[place])


def test_links_are_those_that_the_joints_move(tmp_path: Path):
    assert load_robot(write_urdf(tmp_path / "arm.urdf", TREE)).links == ("l1", "l2", "l3", "l4")


def test_the_description_wins_over_the_urdfs_transmissions(tmp_path: Path):
    text = "effort_side: motor\njoints: {j1: {reduction: -160, rotor_inertia: 2e-4, effort_gain: 0.5}, j2: }\n"
    robot = load_robot(described(tmp_path, text, reductions=(50.0, 80.0)))
    np.testing.assert_array_equal(robot.reduction, [-160.0, 80.0])
    np.testing.assert_array_equal(robot.effort_gain, [0.5, 1.0])
    np.testing.assert_allclose(robot.standard_parameters()[20:], [160.0**2 * 2e-4, 0.0])


def test_a_reversing_gear_reverses_the_recorded_torque(tmp_path: Path):
    text = "effort_side: motor\njoints: {j1: {reduction: -50}, j2: {reduction: 50}}\n"
    robot = load_robot(described(tmp_path, text))
    np.testing.assert_array_equal(robot.row_scale, [-0.02, 0.02])
    np.testing.assert_array_equal(robot.drive_sign, [-1.0, 1.0])
    np.testing.assert_allclose(robot.torque_limit, [1.0, 1.0])


def test_torque_has_the_unit_of_the_side_it_is_recorded_on(tmp_path: Path):
    joint = load_robot(write_urdf(tmp_path / "arm.urdf", TREE))
    assert [joint.torque_unit(i) for i in range(4)] == ["N m", "N", "N m", "N m"]
    assert replace(joint, effort_side="motor").torque_unit(1) == "N m"


def test_effort_side_is_needed_when_reductions_are_given(tmp_path: Path):
    path = described(tmp_path, "joints: {j1: {reduction: 100}, j2: {}}\n")
    assert refusal(path).startswith(f"{path}: effort_side: missing")
    path = described(tmp_path, "", reductions=(100.0,))
    assert refusal(path).startswith(f"{path}: effort_side: missing")
    assert load_robot(described(tmp_path, "")).effort_side == "joint"


@pytest.mark.parametrize(
    ("text", "key", "said"),
    [
        ("joints: {j1: {}, J2: {}}\n", "joints.J2", "did you mean j2?"),
        ("joints: {shoulder: {}}\n", "joints.shoulder", "it has j1, j2"),
        ("locked: {jj2: 0}\n", "locked.jj2", "did you mean j2?"),
        ("joints: {j1: {}}\nlocked: {j1: 0}\n", "locked.j1", "also under joints"),
        ("joints: {}\n", "joints", "none to identify"),
        ("locked: {j1: 0, j2: 0}\n", "joints", "none to identify"),
    ],
)
def test_joints_that_cannot_be_are_refused(tmp_path: Path, text: str, key: str, said: str):
    path = described(tmp_path, text)
    message = refusal(path)
    assert message.startswith(f"{path}: {key}: ")
    assert said in message


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_joints_of_several_degrees_of_freedom_are_refused(tmp_path: Path, kind: str):
    links = (*PLANAR_2R, Link(kind=kind, xyz=(0.1, 0, 0)))
    path = described(tmp_path, "", links)
    message = refusal(path)
    assert message.startswith(f"{tmp_path / 'arm.urdf'}: joint j3 is of type {kind}")
    path = described(tmp_path, "joints: {j1: {}, j3: {}}\n", links)
    assert refusal(path).startswith(f"{path}: joints.j3: a {kind} joint cannot be identified")


def test_a_fixed_joint_cannot_be_identified(tmp_path: Path):
    path = described(tmp_path, "joints: {j1: {}, j3: {}}\n", (*PLANAR_2R, Link(kind="fixed")))
    assert "joints.j3: a fixed joint cannot be identified; the movable joints are j1, j2" in refusal(path)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"<robot name='a'><link name='b'>", "not well-formed XML"),
        (b"", "not well-formed XML"),
        (bytes(range(256)), "not well-formed XML"),
        (b"<mujoco><worldbody/></mujoco>", "the root element is <mujoco>"),
        (b"<robot name='a'/>", "not a usable URDF"),
        (
            b"<robot name='a'><link name='b'/><joint name='j1' type='revolute'><parent link='b'/><child link='c'/>"
            b"<axis xyz='0 0 1'/><limit effort='1' velocity='1'/></joint></robot>",
            "not a usable URDF",
        ),
        (
            b"<robot name='a'><link name='b'/><link name='c'/><joint name='j1' type='revolute'><parent link='b'/>"
            b"<child link='c'/><axis xyz='0 zero 1'/><limit effort='1' velocity='1'/></joint></robot>",
            "not a usable URDF",
        ),
    ],
)
def test_what_is_no_urdf_is_refused(tmp_path: Path, capfd: pytest.CaptureFixture[str], content: bytes, said: str):
    path = tmp_path / "robot.yaml"
    path.write_text("urdf: arm.urdf\n", encoding="utf-8")
    (tmp_path / "arm.urdf").write_bytes(content)
    message = refusal(path)
    assert message.startswith(str(tmp_path / "arm.urdf"))
    assert said in message
    # The URDF parser's own lines do not reach the user.
    assert capfd.readouterr().err == ""


def test_a_missing_urdf_is_refused(tmp_path: Path):
    path = tmp_path / "robot.yaml"
    path.write_text("urdf: nowhere.urdf\n", encoding="utf-8")
    assert refusal(path) == f"{path}: urdf: no such file: {tmp_path / 'nowhere.urdf'}"
    path.write_text("urdf: .\n", encoding="utf-8")
    assert refusal(path).startswith(f"{path}: urdf: cannot read")
    assert str(tmp_path / "lost.urdf") in refusal(tmp_path / "lost.urdf")


@pytest.mark.parametrize(
    ("value", "said"), [("0", "is 0"), ("fast", "expected a number"), ("nan", "expected"), ("inf", "expected")]
)
def test_a_transmission_that_makes_no_sense_is_refused(tmp_path: Path, value: str, said: str):
    path = described(tmp_path, "effort_side: motor\n", reductions=(100.0,))
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(urdf.read_text().replace("100.0", value))
    message = refusal(path)
    assert message.startswith(f"{urdf}: transmission of j1: mechanicalReduction")
    assert said in message


def test_a_reduction_in_the_urdf_of_a_joint_that_is_locked_does_not_matter(tmp_path: Path):
    robot = load_robot(described(tmp_path, "joints: {j2: {}}\n", reductions=(100.0,)))
    assert robot.effort_side == "joint"


def test_the_embedded_urdf_is_there():
    assert embedded_urdf().is_file()


def test_acceleration_and_jerk_limits_are_those_of_the_description(tmp_path: Path):
    write_urdf(tmp_path / "arm.urdf", [Link(), Link()])
    text = "urdf: arm.urdf\njoints: {j2: {acceleration_limit: 15}, j1: {jerk_limit: 5e3, acceleration_limit: 7.5}}\n"
    (tmp_path / "robot.yaml").write_text(text, encoding="utf-8")
    robot = load_robot(tmp_path / "robot.yaml")
    np.testing.assert_array_equal(robot.acceleration_limit, [15.0, 7.5])
    np.testing.assert_array_equal(robot.jerk_limit, [np.inf, 5e3])
    # Both use them where nothing else is said.
    assert limits_of(robot, share=1.0).jerk[1] == 5e3
    np.testing.assert_array_equal(joint_limits(robot, accelerations={"j2": 4.0}).acceleration, [4.0, 7.5])
