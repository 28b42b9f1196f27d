"""What keeps a URDF from being one tree."""

from __future__ import annotations

from xml.etree import ElementTree

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scara_ident.robot.urdf_validation import urdf_fault


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
def test_a_tree_cut_in_two_is_told(tree, data: st.DataObject):
    links, joints = tree
    lost = data.draw(st.sampled_from(joints))
    fault = urdf_fault(robot(links, [joint for joint in joints if joint != lost]))
    assert fault is not None
    assert fault.endswith("hang on no joint; only one, the base, may")
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
    ],
)
def test_a_fault_is_told_by_name(links: list[str], joints: list[tuple[str, str, str]], said: str):
    assert (urdf_fault(robot(links, joints)) or "").startswith(said)


def test_a_joint_without_a_child_is_told():
    tree = ElementTree.fromstring('<robot><link name="a"/><joint name="j"><parent link="a"/><child/></joint></robot>')
    assert urdf_fault(tree) == "joint 'j' has no child link; name it"
