from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import yaml

from scara_ident.export.ros2 import ros2_text
from tests.arms import rnea
from tests.export.arms import branched
from tests.export.identified import identified, model_torque, states


def test_parameters_are_those_of_the_model_in_the_order_of_its_joints(models) -> None:
    found = models["scara", False]
    armature = found.standard[20:]
    text = ros2_text(found, found.value, armature, "arm.urdf", ("one line",))
    assert text.startswith("# one line\n")
    # ROS 2's parser knows neither anchors nor aliases.
    assert not any(isinstance(token, yaml.AnchorToken | yaml.AliasToken) for token in yaml.scan(text))
    content = yaml.safe_load(text)
    given = content["computed_torque"]["ros__parameters"]
    value = dict(zip(found.model.names, found.value, strict=True))
    assert given["friction"]["quadratic"] == [value["a21"], value["a22"]]
    assert given["offset"] == [value["p_o1"], value["p_o2"]]
    assert given["armature"] == armature.tolist()
    assert given["reduction"] == [100.0, 100.0] and given["effort_side"] == "motor"
    trajectory = content["joint_trajectory_controller"]["ros__parameters"]
    assert trajectory["joints"] == list(found.robot.joints)
    gains = trajectory["gains"]["joint2"]
    assert gains["ff_velocity_scale"] == value["a12"]
    # Critically damped on the joint's own inertia, which on joint 2 is the same in every pose.
    inertia = (value["P_d4"] + value["P_d5"]) / 100.0
    assert gains["d"] ** 2 / (4.0 * gains["p"]) == pytest.approx(inertia, rel=1e-9)


def test_its_equation_is_the_model_s_where_a_gear_reverses(tmp_path) -> None:
    robot = branched(tmp_path)
    found = identified(robot)
    text = ros2_text(found, found.value, found.standard[10 * robot.n :], "arm.urdf")
    for line in (
        "# Torque [N m] on the motor side, of q [rad or m], v and a per second:",
        "#   (rnea(q, v, a) + armature * a) / reduction",
        "#   + sign(reduction) * (coulomb * sign(v) + viscous * v + quadratic * v * |v| + cubic * v^3) + offset",
    ):
        assert line in text.splitlines()
    content = yaml.safe_load(text)
    given, friction = content["computed_torque"]["ros__parameters"], {}
    for word, values in given["friction"].items():
        friction[word] = np.array(values)[:, None]
    motion = states(robot, 5, 30)
    reduction, v = np.array(given["reduction"])[:, None], motion.v
    torque = (rnea(robot, motion.q, v, motion.a) + np.array(given["armature"])[:, None] * motion.a) / reduction
    # The bodies of these states are those of the URDF.
    bodies = replace(found, value=found.value.copy())
    bodies.value[found.model.place(found.model.rigid_body)] = _nominal(found, given["armature"])
    law = friction["coulomb"] * np.sign(v) + friction["viscous"] * v
    law += friction["quadratic"] * v * np.abs(v) + friction["cubic"] * v**3
    torque += np.sign(reduction) * law + np.array(given["offset"])[:, None]
    expected = model_torque(found, bodies.value, motion)
    np.testing.assert_allclose(torque, expected, rtol=0, atol=1e-9 * np.max(np.abs(expected)))


def _nominal(found, armature):
    """Base parameters of the URDF's bodies with other rotors."""
    body = found.model.rigid_body
    standard = found.robot.standard_parameters()
    standard[10 * found.robot.n :] = armature
    return (body.base.grouping @ standard)[body.kept]


def test_a_loop_of_its_gains_pulls_the_joint_to_its_place_where_the_gear_reverses(tmp_path) -> None:
    robot = branched(tmp_path)
    found = identified(robot)
    text = ros2_text(found, found.value, found.standard[10 * robot.n :], "arm.urdf")
    gains = yaml.safe_load(text)["joint_trajectory_controller"]["ros__parameters"]["gains"]
    assert -1.0 in robot.drive_sign
    for joint, scale in zip(robot.joints, robot.row_scale, strict=True):
        # As torque at the joint all of them work against an error.
        assert all(gains[joint][key] / scale > 0.0 for key in ("p", "d", "ff_velocity_scale"))
