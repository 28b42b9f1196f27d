import pytest

from scara_ident.cli.joint_values import joint_numbers, joint_ranges, numbers
from scara_ident.errors import UsageError


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
