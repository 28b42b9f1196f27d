from inspect import signature

import pytest

from scara_ident.cli.ask import ask
from scara_ident.cli.excite import excite
from scara_ident.cli.joint_values import (
    joint_numbers,
    joint_ranges,
    limits_by_joint,
    motion_limits,
    numbers,
    with_motion_limits,
)
from scara_ident.errors import UsageError
from scara_ident.excitation.limits import CLEARANCE, SHARE, limits_of
from scara_ident.robot.robot import load_robot


def test_values_of_joints_are_read():
    assert joint_numbers(["joint1=1.5", "a-b=-2e-1"], "--torque") == {"joint1": 1.5, "a-b": -0.2}
    assert joint_ranges(["joint1=-1.5..2", "joint2=.1...9"], "--range") == {"joint1": (-1.5, 2.0), "joint2": (0.1, 0.9)}
    assert numbers("0, -1.5,2", "--start") == [0.0, -1.5, 2.0]
    assert joint_numbers(None, "--torque") == {} == joint_ranges(None, "--range")
    assert numbers(None, "--start") is None


@pytest.mark.parametrize("word", ["joint1", "joint1=", "=2", ""])
def test_a_word_without_joint_or_value_is_said(word):
    with pytest.raises(UsageError, match=r"--torque .*expected JOINT=VALUE"):
        joint_numbers([word], "--torque")


@pytest.mark.parametrize(("word", "said"), [("j=1", "LOWER..UPPER"), ("j=1..x", "'x' is not a number"), ("j=..", "''")])
def test_a_range_that_is_none_is_said(word, said):
    with pytest.raises(UsageError, match=said):
        joint_ranges([word], "--range")


def test_commands_that_design_have_every_option_of_limits_with_the_defaults_of_the_package():
    known = {*signature(limits_of).parameters} - {"robot"}
    for command in (ask, excite):
        given = signature(command).parameters
        assert known <= set(given) and "limits" not in given
        assert (given["share"].default, given["clearance"].default) == (SHARE, CLEARANCE)


def test_limits_are_gathered_from_their_options():
    found = motion_limits(load_robot(), ["joint1=-1..2"], None, ["joint2=9"], floor=0.1, share=1.0, tool_speed=0.7)
    assert (found.lower[0], found.acceleration[1], found.floor, found.tool_speed) == (-1.0, 9.0, 0.1, 0.7)

    @with_motion_limits
    def command(first: int, *, limits, last: str = "b"):
        return first, limits(load_robot()).lower[0], last

    assert command(1, ranges=["joint1=-1..2"], share=1.0) == (1, -1.0, "b")
    assert [*signature(command).parameters][::13] == ["first", "last"]
    assert limits_by_joint(None, powers=["joint1=5"]) == {"ranges": {}, "powers": {"joint1": 5.0}}
