"""Limits of a motion, and postures that keep them at rest."""

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.calling import by_command
from scara_ident.errors import RobotError, UsageError
from scara_ident.excitation import (
    design_excitation,
    limits_of,
    nominal_parameters,
)
from scara_ident.model.model import build_model
from scara_ident.paper import table5_parameters
from scara_ident.robot.robot import load_robot
from tests.arms import Link, write_urdf
from tests.excitation.designs import COMPLETE, SCARA
from tests.excitation.made import panda


def test_a_joint_without_limits_is_said(tmp_path):
    urdf = write_urdf(tmp_path / "arm.urdf", [Link(kind="continuous"), Link(xyz=(0.3, 0.0, 0.0))])
    with pytest.raises(RobotError, match=r"joint 'j1' has no position limits;.*or ranges={'j1': "):
        design_excitation(build_model(load_robot(urdf)))
    given = limits_of(load_robot(urdf), ranges={"j1": (-3.0, 3.0)}, share=1.0)
    assert given.upper[0] == 3.0
    urdf.write_text(urdf.read_text().replace(' velocity="4"', ' velocity="0"'))
    with pytest.raises(RobotError, match="joint 'j1' has no velocity limit"):
        limits_of(load_robot(urdf), ranges={"j1": (-3.0, 3.0)})


def test_all_limits_that_lack_are_said_at_once(tmp_path):
    """Of an arm that a CAD program wrote, continuous and with velocity="0", they were asked for one by one."""
    urdf = write_urdf(tmp_path / "arm.urdf", [Link(kind="continuous"), Link(xyz=(0.3, 0.0, 0.0))])
    urdf.write_text(urdf.read_text().replace(' velocity="4"', ' velocity="0"'))
    with pytest.raises(RobotError) as caught, by_command():
        limits_of(load_robot(urdf))
    said = str(caught.value)
    assert "joint 'j1' has no position limits nor velocity limit, joint 'j2' has no velocity limit" in said
    assert "--range j1=LOWER..UPPER --velocity j1=V --velocity j2=V" in said
    assert "--range j2" not in said
    with pytest.raises(RobotError) as caught:
        limits_of(load_robot(urdf))
    words = "ranges={'j1': (LOWER, UPPER)} velocities={'j1': V} velocities={'j2': V}"
    assert words in str(caught.value) and "--" not in str(caught.value)
    given = {"ranges": {"j1": (-3.0, 3.0)}, "velocities": {"j1": 1.0, "j2": 1.0}}
    assert limits_of(load_robot(urdf), **given).upper[0] < 3.0


def test_a_range_that_is_a_lock_is_said():
    with pytest.raises(
        RobotError, match=r"joint 'joint1' cannot move: its range is 0\.\.1e-05 rad; .* or lock the joint"
    ):
        limits_of(SCARA, ranges={"joint1": (0.0, 1e-5)})
    assert limits_of(SCARA, ranges={"joint1": (0.0, 2e-3)}).upper[0] < 2e-3


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"ranges": {"joint9": (0.0, 1.0)}}, "'joint9': the robot has no such joint; its joints: joint1, joint2"),
        ({"ranges": {"joint1": (1.0, 1.0)}}, "range of joint1"),
        ({"velocities": {"joint1": 0.0}}, "velocity limit of joint1"),
        ({"tool_acceleration": -1.0}, "tool acceleration -1"),
        ({"share": 1.5}, "share of the limits 1.5"),
        ({"share": np.nan}, "share of the limits nan"),
        ({"floor": np.nan}, "floor nan: expected a height"),
        ({"tool_speed": 0.0}, "tool speed 0"),
        ({"accelerations": {"joint1": -1.0}}, "acceleration limit of joint1"),
        ({"jerks": {"joint3": 1.0}}, "jerk for 'joint3'"),
    ],
)
def test_limits_that_make_no_sense_are_said(given, said):
    with pytest.raises(UsageError, match=said):
        limits_of(SCARA, **given)


def test_the_scara_has_the_papers_tool_acceleration_and_other_arms_none():
    assert limits_of(SCARA).tool_acceleration == 9.0
    assert limits_of(SCARA, tool_acceleration=np.inf).tool is None
    assert limits_of(panda()).tool_acceleration == np.inf
    assert limits_of(SCARA).torque[0] == pytest.approx(0.8 * 2.0)
    half = limits_of(SCARA, share=0.5)
    np.testing.assert_allclose(half.velocity, 0.5 * SCARA.velocity_limit)
    np.testing.assert_allclose(half.centre, limits_of(SCARA).centre)


def test_the_scara_is_foreseen_with_the_papers_friction_unless_determined_better():
    names = COMPLETE.names
    value = nominal_parameters(COMPLETE)
    np.testing.assert_array_equal(value[5:], table5_parameters("OJD")[5:])
    assert nominal_parameters(COMPLETE, {"a01": 0.3})[5:].tolist() == [0.3] + [0.0] * 9
    assert not np.any(nominal_parameters(COMPLETE, {})[5:])
    assert dict(zip(names, value, strict=True))["a31"] == 0.0
    joint_side = replace(SCARA, effort_side="joint")
    assert not np.any(nominal_parameters(build_model(joint_side))[5:])
