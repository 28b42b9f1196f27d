"""Which pairs are watched, and what is said of the others."""

import numpy as np
import pytest

from scara_ident.errors import UsageError
from scara_ident.excitation import limits_of
from scara_ident.excitation.watched_pairs import clearance_of
from scara_ident.robot.robot import load_robot
from tests.excitation.made import BALL, ENDS, drawn, middle, upright


def test_what_touches_in_any_case_is_left_out_and_said(tmp_path):
    robot = upright(tmp_path, '<sphere radius="0.9"/>', BALL, BALL)
    clearance = clearance_of(robot, *ENDS, margin=0.02, floor=0.5)
    assert clearance.pairs == ((1, 3, "floor"), (2, 3, "floor"))
    (note,) = clearance.notes
    assert note.startswith("Not kept 0.02 m apart, because they touch") and note.endswith(": l1 and floor; l1 and l3.")


def test_a_margin_that_nothing_can_keep_leaves_out_only_what_cannot_collide(tmp_path):
    # Both are always nearer than 2 m; only the second reaches the floor.
    clearance = clearance_of(upright(tmp_path, BALL, BALL, ""), *ENDS, margin=2.0, floor=-0.5)
    assert clearance.pairs == ((1, 2, "floor"),)
    assert clearance.notes[1].endswith(": l1 and floor.")


def test_links_beyond_a_locked_joint_are_kept_apart(tmp_path):
    upright(tmp_path, BALL, BALL, BALL)
    (tmp_path / "robot.yaml").write_text(
        "urdf: arm.urdf\neffort_side: joint\njoints: {j1: {}, j3: {}}\nlocked: {j2: 0.5}\n"
    )
    clearance = clearance_of(load_robot(tmp_path / "robot.yaml"), *(each[:2] for each in ENDS), margin=0.02)
    # The third link folds back onto the first, which is one body with the second.
    assert clearance.pairs == ((0, 2, "self"),)
    q = drawn()[:2]
    full = np.array([q[0], np.full(q.shape[1], 0.5), q[1]])
    expected = np.linalg.norm(middle(full, 2) - middle(full, 0), axis=0) - 0.1
    np.testing.assert_allclose(clearance.nearest(q, np.inf).distance, expected, atol=1e-9)


def test_an_arm_without_shapes_or_with_lost_ones_says_so(tmp_path):
    bare = clearance_of(upright(tmp_path, "", "", ""), *ENDS, margin=0.02, floor=0.0)
    assert bare.groups == () and "arm.urdf has no collision shapes; run the motion" in bare.notes[0]
    lost = clearance_of(upright(tmp_path, "", "", '<mesh filename="package://gone/l3.stl"/>'), *ENDS, margin=0.02)
    assert lost.groups == () and "link l3: mesh package://gone/l3.stl is not found" in lost.notes[0]
    near = clearance_of(upright(tmp_path, "", BALL, BALL), *ENDS, margin=0.02)
    assert near.groups == () and "are neighbours" in near.notes[0]
    assert near.notes[1] == "Links without a collision shape are not checked: l1."
    assert near.notes[0].count("shapes") == 1
    seated = upright(tmp_path, "", "", "")
    base = f'<link name="base"><collision><geometry>{BALL}</geometry></collision></link>'
    seated.urdf.write_text(seated.urdf.read_text().replace('<link name="base"/>', base))
    for floor in (0.0, -np.inf):
        (note,) = clearance_of(load_robot(seated.urdf), *ENDS, margin=0.02, floor=floor).notes
        assert "arm.urdf has no collision shapes on the links that move (l1, l2, l3); run the motion" in note
    robot = upright(tmp_path, "", "", "")
    with pytest.raises(UsageError, match="boxes: Collisions were not checked"):
        limits_of(robot, boxes=[((1.0, 0.0, 0.0), (0.1, 0.1, 0.1))])
    with pytest.raises(UsageError, match=r"no collision shapes.* Give the URDF collision shapes, or no boxes"):
        limits_of(robot, boxes=[((1.0, 0.0, 0.0), (0.1, 0.1, 0.1))])
    with pytest.raises(UsageError, match="boxes without a clearance"):
        limits_of(robot, clearance=None, boxes=[((1.0, 0.0, 0.0), (0.1, 0.1, 0.1))])
    with pytest.raises(UsageError, match="clearance -1 m"):
        clearance_of(robot, *ENDS, margin=-1.0)
    with pytest.raises(UsageError, match="edges above 0"):
        clearance_of(robot, *ENDS, margin=0.0, boxes=[((1.0, 0.0, 0.0), (0.1, 0.0, 0.1))])


def test_a_box_that_the_arm_can_never_leave_is_refused_for_that(tmp_path):
    """It was said to lack collision shapes, or was left out with a note while all limits held."""
    around = [((0.0, 0.0, 0.0), (50.0, 50.0, 50.0))]
    for shapes in (("", BALL, ""), (BALL, BALL, BALL)):
        robot = upright(tmp_path, *shapes)
        with pytest.raises(UsageError, match=r"closer in every posture: .*box1.* Give boxes that the arm can leave"):
            limits_of(robot, boxes=around)
    # One box that it is always in beside another, as a pedestal, is left out and said.
    kept = limits_of(robot, boxes=[*around, ((1.5, 0.0, 1.0), (0.1, 0.1, 0.1))]).clearance
    assert "box1" in kept.notes[0] and any(group == "box2" for *_, group in kept.pairs)
