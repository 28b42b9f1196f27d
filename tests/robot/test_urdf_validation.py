"""What keeps a URDF from being one tree."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scara_ident.robot.urdf_validation import urdf_fault
from tests.arms import example_urdf


def robot(links: list[str], joints: list[tuple[str, str, str]]) -> ElementTree.Element:
    """Return links and joints (name, parent, child)."""
    text = "".join(f'<link name="{name}"/>' for name in links)
    text += "".join(
        f'<joint name="{name}"><parent link="{parent}"/><child link="{child}"/></joint>'
        for name, parent, child in joints
    )
    return ElementTree.fromstring(f"<robot>{text}</robot>")


@st.composite
def trees(draw: st.DrawFn) -> tuple[list[str], list[tuple[str, str, str]]]:
    """Draw a tree of two to nine links, links and joints in any order."""
    count = draw(st.integers(2, 9))
    joints = [(f"j{k}", f"l{draw(st.integers(0, k - 1))}", f"l{k}") for k in range(1, count)]
    return draw(st.permutations([f"l{k}" for k in range(count)])), draw(st.permutations(joints))


@settings(max_examples=60)
@given(tree=trees(), data=st.data())
def test_a_tree_has_no_fault_and_one_more_joint_in_it_closes_a_loop(tree, data: st.DataObject):
    links, joints = tree
    assert urdf_fault(robot(links, joints)) is None
    parent, child = data.draw(st.sampled_from(links)), data.draw(st.sampled_from(links))
    fault = urdf_fault(robot(links, [*joints, ("more", parent, child)]))
    assert fault is not None
    assert "a URDF has no loops" in fault


@settings(max_examples=30)
@given(tree=trees(), data=st.data())
def test_a_tree_cut_in_two_is_reported(tree, data: st.DataObject):
    links, joints = tree
    lost = data.draw(st.sampled_from(joints))
    fault = urdf_fault(robot(links, [joint for joint in joints if joint != lost]))
    assert fault is not None
    assert fault.endswith("have no joint to a parent; only one link, the base, may have none")
    assert repr(lost[2]) in fault


@pytest.mark.parametrize(
    ("links", "joints", "said"),
    [
        (["a", "b", "b"], [("j", "a", "b")], "two links are named 'b'; rename one"),
        (["a", "b", "c"], [("j", "a", "b"), ("j", "b", "c")], "two joints are named 'j'; rename one"),
        (["a", "b"], [("j", "a", "c")], "joint 'j' names 'c' as its child, and there is no such link"),
        (["a", "b"], [("j", "c", "b")], "joint 'j' names 'c' as its parent, and there is no such link"),
        (["a", "b", "c"], [("j", "a", "c"), ("k", "b", "c")], "link 'c' is the child of two joints"),
        (["a", "b"], [("j", "a", "b"), ("k", "b", "a")], "every link is the child of a joint"),
        (["a", "b"], [("j", "b", "b")], "joint 'j': link 'b' is its parent and its child; a URDF has no loops"),
        (["a", "b", "c"], [("j", "b", "c"), ("k", "c", "b")], "link 'b' is connected to itself; a URDF has no loops"),
        (["a", "b"], [("", "a", "b")], "a joint has no name"),
        (["a", ""], [("j", "a", "")], "a link has no name"),
    ],
)
def test_a_fault_is_reported_by_name(links: list[str], joints: list[tuple[str, str, str]], said: str):
    assert (urdf_fault(robot(links, joints)) or "").startswith(said)


def test_a_joint_without_a_child_is_reported():
    tree = ElementTree.fromstring('<robot><link name="a"/><joint name="j"><parent link="a"/><child/></joint></robot>')
    assert urdf_fault(tree) == "joint 'j' has no child link; name it"


GOOD = """
<robot name="r">
  <link name="base"/>
  <link name="l1"><inertial><origin xyz="0.1 0 0" rpy="0 0 0"/><mass value="2"/>
    <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>
  <link name="l2"/>
  <joint name="j1" type="revolute"><parent link="base"/><child link="l1"/><origin xyz="0 0 0.3"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="2" effort="50" velocity="4"/></joint>
  <joint name="j2" type="prismatic"><parent link="l1"/><child link="l2"/><axis xyz="1 0 0"/>
    <limit lower="0" upper="0.5" effort="50" velocity="4"/><mimic joint="j1" multiplier="0.5"/></joint>
</robot>
"""
NUMBER = "expected a finite number, with a point and without a unit"


def fault(old: str = "", new: str = "") -> str:
    assert GOOD.count(old) or not old
    return urdf_fault(ElementTree.fromstring(GOOD.replace(old, new, 1))) or ""


def test_a_right_robot_has_no_fault_and_neither_have_those_of_makers():
    assert fault() == ""
    # What the arithmetic of a CAD program leaves of a moment of 0.
    assert fault('ixx="0.1"', 'ixx="-5.4e-20"') == ""
    # All three of a point mass are, as of the iCub's hip, and no more than that.
    point = '<inertia ixx="{0}" ixy="0" ixz="0" iyy="{0}" iyz="0" izz="0"/>'
    whole = '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/>'
    assert fault(whole, point.format(-5.4e-20)) == ""
    assert fault(whole, point.format(-1e-9)) == "link 'l1': ixx is -1e-09, but it cannot be below 0; correct it"
    assert (
        fault(
            '<link name="l2"/>',
            '<link name="l2"><visual><geometry><mesh filename="$(find p)/a.stl"/></geometry></visual></link>',
        )
        == ""
    )
    for name in ("ur5_robot", "panda", "talos_full_v2", "romeo", "allegro_right_hand"):
        assert urdf_fault(ElementTree.parse(example_urdf(f"{name}.urdf")).getroot()) is None


@pytest.mark.parametrize("value", ["nan", "inf", "", "5kg", "1,5", "heavy", "1e400", "0x10", "1_0", "1 2"])
@pytest.mark.parametrize(
    ("old", "told"),
    [
        ('<mass value="2"', "link 'l1': value of <mass>"),
        ('izz="0.1"', "link 'l1': izz of <inertia>"),
        ('upper="2"', "joint 'j1': upper of <limit>"),
        ('multiplier="0.5"', "joint 'j2': multiplier of <mimic>"),
    ],
)
def test_what_is_no_number_is_reported_with_its_place(old: str, told: str, value: str):
    said = fault(old, f'{old.partition(chr(34))[0]}"{value}"')
    assert said == f"{told} is {value!r}; {NUMBER}"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('value="2"', 'value="-2"', "link 'l1': mass is -2, but it cannot be below 0"),
        ('iyy="0.1"', 'iyy="-0.1"', "link 'l1': iyy is -0.1, but it cannot be below 0"),
        ('value="2"', 'value="1e300"', "link 'l1': mass is 1e+300 kg, which no link of a robot has"),
        ('<mass value="2"/>', "", "link 'l1': its <inertial> has no mass; give it, or leave out <inertial>"),
        ('iyz="0"', "", "link 'l1': its <inertial> has no iyz; give it"),
        ('xyz="0.1 0 0"', 'xyz="5000 0 0"', "link 'l1': its centre of mass is 5000 m away, and the robot is 1.8 m long"),
        ('xyz="0.1 0 0"', 'xyz="120 0 0"', "link 'l1': its centre of mass is 120 m away"),
        ('xyz="0.1 0 0"', 'xyz="0.1 0"', "link 'l1': xyz of <origin> is '0.1 0'; expected 3 finite numbers"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 0"/>', "joint 'j1': its axis is 0 0 0, which has no direction; give one"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 1e-300 0"/>', "joint 'j1': its axis is 0 1e-300 0, which has no direction"),
        ('lower="-1"', 'lower="3"', "joint 'j1': its lower limit 3 is above its upper limit 2; exchange or correct"),
        ('velocity="4"', 'velocity="-4"', "joint 'j1': velocity of <limit> is -4; expected 0 or more"),
        ('effort="50"', "", "joint 'j1': its <limit> has no effort; give it"),
        ('<limit lower="-1" upper="2" effort="50" velocity="4"/>', "", "joint 'j1': a revolute joint has no <limit>"),
        ('mimic joint="j1"', 'mimic joint="j2"', "joint 'j2' mimics itself; name a joint that moves by itself"),
        ('mimic joint="j1"', 'mimic joint="j3"', "joint 'j2' mimics 'j3', and there is no such joint"),
        ('mimic joint="j1"', "mimic", "joint 'j2' mimics '', and there is no such joint"),
        ('<axis xyz="0 0 1"/>', '<axis xyz="0 0 1"/><mimic joint="j2"/>', "joint 'j1' mimics 'j2', which follows it in turn"),
        ('value="2"', 'value="${m}"', "'${m}' in <mass> is xacro's; run xacro first"),
        ("<link", '<x:include xmlns:x="http://www.ros.org/wiki/xacro" filename="a"/><link', "it has <xacro:include>, so"),
    ],
)  # fmt: skip
def test_what_no_robot_has_is_reported_with_what_to_do(old: str, new: str, said: str):
    assert fault(old, new).startswith(said)
