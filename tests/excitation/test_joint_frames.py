"""Frames of many postures against Pinocchio's, one by one."""

import numpy as np
import pinocchio as pin

from scara_ident.excitation.joint_frames import joint_frames
from scara_ident.robot.kinematics import axis
from tests.excitation.made import scara_with_quill


def test_frames_axes_and_points_are_pinocchios():
    robot = scara_with_quill()
    q = np.random.default_rng(0).uniform(-1.0, 1.0, (robot.n, 5))
    found = joint_frames(robot, q)
    point = np.array([0.1, -0.2, 0.3])
    data, back = robot.model.createData(), np.argsort(robot.order)
    places = found.centres(np.array([3]), point[None])
    for k in range(5):
        pin.forwardKinematics(robot.model, data, q[back, k])
        for joint in range(1, 4):
            np.testing.assert_allclose(found.turn[joint, ..., k], data.oMi[joint].rotation, atol=1e-14)
            np.testing.assert_allclose(found.place[joint, :, k], data.oMi[joint].translation, atol=1e-14)
        np.testing.assert_allclose(places[0, :, k], data.oMi[3].act(point), atol=1e-14)
        for place in np.flatnonzero(~robot.prismatic):
            np.testing.assert_allclose(found.axis[place, :, k], axis(robot, data, place), atol=1e-14)
