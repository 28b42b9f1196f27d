"""What is said of a channel that is not as the mapping says, and how faults of one joint become one."""

from __future__ import annotations

import pytest

from scara_ident.errors import RecordingError
from scara_ident.identification.channel_fault import ChannelFault, faults_of, merged, refuse_exchanged
from scara_ident.identification.channel_reading import JointReading, Signal

JOINTS = ("a", "b", "c")


def turned(signal: Signal, *joints: str) -> ChannelFault:
    return ChannelFault(signal, joints, False, 0.4, 0.01)


def said(*faults: ChannelFault) -> list[tuple[str, tuple[str, ...]]]:
    return [(fault.signal, fault.joints) for fault in merged(faults, JOINTS)]


def test_what_is_turned_twice_is_right() -> None:
    assert said() == []
    assert said(turned("effort", "b"), turned("position", "a")) == [("effort", ("b",)), ("position", ("a",))]
    assert said(turned("effort and position", "b"), turned("effort", "b")) == [("position", ("b",))]
    assert said(turned("effort", "b"), turned("position", "b")) == [("effort and position", ("b",))]
    assert said(turned("effort", "b"), turned("effort", *JOINTS)) == [("effort", ("a", "c"))]
    assert said(turned("effort", "b"), turned("effort", "b")) == []


def test_turns_beside_an_exchange_stay_apart() -> None:
    """Before and after it the channels of a name are not the same."""
    faults = turned("effort", "a"), ChannelFault("effort", ("a", "b"), True, 0.3, 0.01), turned("effort", "a")
    assert merged(faults, JOINTS) == faults


def test_what_to_do_is_said_in_one_line() -> None:
    each = {
        turned("effort", "b"): "negate effort_gain of b in robot.yaml",
        turned("position", "b"): "scale: -1",
        turned("effort and position", "b"): "negate the axis of b in the URDF",
        ChannelFault("effort", JOINTS, False, 0.1, 0.1): "negate effort_gain in robot.yaml",
        ChannelFault("effort", JOINTS, False, 0.1, 0.1, by_bodies=True): "effort_gain: -1",
    }
    for fault, what in each.items():
        assert what in str(fault) and "\n" not in str(fault)


def test_only_what_no_parameter_survives_is_refused() -> None:
    refuse_exchanged([turned("effort", "b")])
    for fault in (
        ChannelFault("effort", ("a", "b"), True, 0.3, 0.01),
        ChannelFault("effort", ("a",), False, 0.3, 0.01, unsigned=True),
    ):
        with pytest.raises(RecordingError):
            refuse_exchanged([fault])


def test_the_zeros_of_all_joints_are_one_fault_and_signs_of_others_their_own() -> None:
    reading = JointReading(1, 1, 1), JointReading(-1), JointReading(1, -1, 2)
    zeros, sign = faults_of(reading, JOINTS, 1.0, 0.01, ("gravity upside down",))
    assert zeros.readings == {"a": reading[0], "c": reading[2]}
    assert (sign.signal, sign.joints) == ("effort", ("b",))
    said = str(zeros)
    assert "falls from 100 to 1 % (it does so too with gravity upside down)" in said
    assert "with +90 deg on a and +180 deg (position of opposite sign) on c" in said
    assert "negate position scale and offset of c in robot.yaml, then add in robot.yaml" in said
    assert "offset: {a: 1.57080, c: 3.14159} in rad" in said
    assert "\n" not in said


def test_a_zero_and_a_sign_of_one_joint_are_one_fault() -> None:
    """What was added before a sign turned round is taken off after it."""
    (zero,) = faults_of((JointReading(), JointReading(1, 1, 1), JointReading()), JOINTS, 0.4, 0.1)
    (fault,) = merged((zero, turned("position", "b")), JOINTS)
    assert fault.readings == {"b": JointReading(1, -1, -1)}
    (fault,) = merged((turned("position", "b"), zero), JOINTS)
    assert fault.readings == {"b": JointReading(1, -1, 1)}
    assert merged((zero, zero, zero, zero), JOINTS) == ()
