"""Channels go to the joints of the arm, and what hangs on it is locked."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scara_ident.errors import UsageError
from scara_ident.inspection.chain import arm_of, is_still, longest_chain, numbered_joints
from tests.arms import Link, write_urdf


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    """Two wheels, an arm of three joints, and two fingers without coupling."""
    wheel = Link(kind="continuous", parent=-2)
    arm = (Link(parent=-2), Link(), Link(), Link(kind="prismatic"), Link(kind="prismatic", parent=4))
    return write_urdf(tmp_path / "arm.urdf", (wheel, wheel, *arm))


def test_numbers_belong_to_all_joints_or_to_those_of_the_arm(urdf: Path):
    arm = arm_of(urdf)
    assert numbered_joints(arm, 7) == list(range(7))
    assert numbered_joints(arm, 3) == [2, 3, 4]
    assert numbered_joints(arm, 9) == list(range(7))
    assert numbered_joints(arm, 5) is None
    assert longest_chain(arm) == [2, 3, 4, 5]


def test_a_chain_counts_from_the_base_outwards(tmp_path: Path):
    # The file names the last joint first.
    text = write_urdf(tmp_path / "arm.urdf", (Link(), Link(), Link())).read_text()
    start, end = text.index('<joint name="j3"'), text.rindex("</joint>") + len("</joint>")
    joint = text[start:end]
    text = text.replace(joint, "").replace('<link name="l1">', f'{joint}<link name="l1">')
    (tmp_path / "arm.urdf").write_text(text)
    arm = arm_of(tmp_path / "arm.urdf")
    assert arm.joints == ("j3", "j1", "j2")
    assert numbered_joints(arm, 3) == [1, 2, 0]


def test_a_pattern_takes_joints_and_says_what_there_is(urdf: Path):
    assert arm_of(urdf, "j[345]").joints == ("j3", "j4", "j5")
    with pytest.raises(UsageError, match=r"matches no joint; .* has j1, j2"):
        arm_of(urdf, "arm_.*")
    with pytest.raises(UsageError, match="no regular expression"):
        arm_of(urdf, "j[")


def test_a_column_of_one_value_or_none_is_still():
    assert is_still(np.array([2.0, np.nan, 2.0]))
    assert is_still(np.array([np.nan]))
    assert not is_still(np.array([2.0, 3.0]))
