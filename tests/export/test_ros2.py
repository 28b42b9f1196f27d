from __future__ import annotations

import pytest
import yaml

from scara_ident.export.ros2 import ros2_text


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
