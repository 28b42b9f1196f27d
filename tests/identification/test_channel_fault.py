"""What is said of a channel that is not as the mapping says, and how faults of one joint become one."""

from __future__ import annotations

import pytest

from scara_ident.errors import RecordingError
from scara_ident.identification.channel_fault import ChannelFault, Signal, merged, refuse_exchanged

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
