"""Columns of one quantity are grouped by their names, or by their numbers."""

from __future__ import annotations

from scara_ident.inspection.names import meaning
from scara_ident.inspection.signals import groups, of_group, short_together
from scara_ident.robot.robot import load_robot

ROBOT = load_robot()


def test_named_columns_are_determined_by_number_too_and_unnamed_ones_by_number_only():
    names = ["joint1.position", "joint2.position", "enc[0]", "enc[1]", "joint1.effort"]
    found = groups("position", {name: meaning(name, ROBOT.joints) for name in names}, ROBOT.n)
    assert found == [
        ("{joint}.position", True, {0: "joint1.position", 1: "joint2.position"}),
        ("joint{number}.position", False, {1: "joint1.position", 2: "joint2.position"}),
        ("enc[{number}]", False, {0: "enc[0]", 1: "enc[1]"}),
    ]
    signal, note = of_group("position", *found[2], ROBOT)
    assert signal is not None
    assert (signal.columns, signal.first_number) == ({0: "enc[0]", 1: "enc[1]"}, 0)
    assert "matched to the joints by order" in note


def test_a_group_with_fewer_channels_than_joints_is_no_signal():
    signal, note = of_group("position", "enc[{number}]", False, {0: "enc[0]"}, ROBOT)
    assert signal is None
    assert "1 channel for 2 joints" in note


def test_what_has_as_few_channels_is_said_once():
    """A log of one joint of a UR5e had six notes that differed in a name, each in robot.yaml too."""
    short = [of_group(q, f"{q}{{number}}", False, {0: q}, ROBOT)[1] for q in ("position", "effort")]
    three = of_group("velocity", "w{number}", False, {k: f"w{k}" for k in range(3)}, load_robot("panda"))[1]
    other = "velocity: constant for joint1; check its columns"
    first, second, third = short_together([short[0], other, three, short[1]])
    assert first == other
    assert second.startswith(
        "position position{index}, effort effort{index} each have 1 channel for 2 joints: not used"
    )
    assert third == three


def test_columns_that_differ_in_their_units_alone_are_one_signal():
    """An arm that slides and turns is logged in mm and in degrees: joints of the other unit were locked."""
    names = ["joint1 pos [mm]", "joint2 pos [°]", "q0_mm", "q1_deg"]
    assert groups("position", {name: meaning(name, ROBOT.joints) for name in names}, ROBOT.n) == [
        ("{joint} pos [mm]", True, {0: "joint1 pos [mm]", 1: "joint2 pos [°]"}),
        ("joint{number} pos [mm]", False, {1: "joint1 pos [mm]", 2: "joint2 pos [°]"}),
        ("q{number}_mm", False, {0: "q0_mm", 1: "q1_deg"}),
    ]


def test_one_joint_in_two_units_is_two_signals():
    names = ["joint1 pos [rad]", "joint2 pos [rad]", "joint1 pos [°]", "joint2 pos [°]"]
    found = groups("position", {name: meaning(name, ROBOT.joints) for name in names}, ROBOT.n)
    assert [template for template, by_name, _ in found if by_name] == ["{joint} pos [rad]", "{joint} pos [°]"]
