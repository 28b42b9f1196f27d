import numpy as np
import pinocchio as pin
import pytest

from scara_ident.errors import RobotError
from scara_ident.excitation.tool import tool_motion, tool_of
from scara_ident.paper import OJD, tool_acceleration
from scara_ident.robot.robot import load_robot
from tests.arms import example_urdf
from tests.excitation.made import panda, scara_with_quill

ARMS = {
    "scara": load_robot,
    "quill": scara_with_quill,
    "ur5": lambda: load_robot(example_urdf("ur5_robot.urdf")),
    "panda": panda,
}


@pytest.mark.parametrize("name", ARMS)
def test_the_tool_moves_as_pinocchio_says(name):
    robot = ARMS[name]()
    tool = tool_of(robot)
    rng = np.random.default_rng(0)
    q, v, a = rng.uniform(-2.0, 2.0, (3, robot.n, 5))
    motion = tool_motion(tool, q, v, a)
    model = robot.model
    data, frame = model.createData(), model.getFrameId(tool.name, pin.FrameType.BODY)
    back = np.argsort(robot.order)
    for k in range(5):
        full = pin.integrate(model, pin.neutral(model), q[back, k])
        pin.forwardKinematics(model, data, full, v[back, k], a[back, k])
        pin.updateFramePlacements(model, data)
        speed = pin.getFrameVelocity(model, data, frame, pin.LOCAL_WORLD_ALIGNED).linear
        push = pin.getFrameClassicalAcceleration(model, data, frame, pin.LOCAL_WORLD_ALIGNED).linear
        np.testing.assert_allclose(motion.position[:, k], data.oMf[frame].translation, atol=1e-12)
        np.testing.assert_allclose(motion.velocity[:, k], speed, atol=1e-12)
        np.testing.assert_allclose(motion.acceleration[:, k], push, atol=1e-11)


@pytest.mark.parametrize("name", ARMS)
def test_the_derivatives_of_the_tools_motion_are_those_of_differences(name):
    robot = ARMS[name]()
    tool = tool_of(robot)
    q, v, a = np.random.default_rng(1).uniform(-2.0, 2.0, (3, robot.n, 4))
    motion = tool_motion(tool, q, v, a)
    h = 1e-5
    for joint in range(robot.n):
        d = np.zeros_like(q)
        d[joint] = h
        by_q, by_v = tool_motion(tool, q + d, v, a), tool_motion(tool, q, v + d, a)
        less_q, less_v = tool_motion(tool, q - d, v, a), tool_motion(tool, q, v - d, a)
        slope = (by_q.position - less_q.position) / (2 * h)
        np.testing.assert_allclose(motion.jacobians[0, joint], slope, atol=1e-8)
        slope = (by_q.acceleration - less_q.acceleration) / (2 * h)
        np.testing.assert_allclose(motion.jacobians[2, joint], slope, atol=2e-7)
        slope = (by_v.acceleration - less_v.acceleration) / (2 * h)
        np.testing.assert_allclose(2.0 * motion.jacobians[1, joint], slope, atol=2e-8)


def test_the_tool_of_the_scara_is_the_gripper_of_the_paper():
    robot = load_robot()
    tool = tool_of(robot)
    np.testing.assert_allclose(tool.point, [0.33, 0.0, 0.0])
    moved = OJD.motion(OJD.times(300))
    size = np.linalg.norm(tool_motion(tool, *moved).acceleration, axis=0)
    np.testing.assert_allclose(size, tool_acceleration(*moved), rtol=1e-10)


def test_a_tool_that_the_urdf_lacks_or_that_stands_still_is_said():
    with pytest.raises(RobotError, match=r"no link 'hand'.*link3"):
        tool_of(load_robot(), "hand")
    with pytest.raises(RobotError, match="no identified joint moves 'base_link'"):
        tool_of(load_robot(), "base_link")
