"""Distances of links to one another, to a floor and to boxes against closed forms."""

import pickle

import numpy as np
import pytest

from scara_ident.errors import UsageError
from scara_ident.excitation import Effort, InfeasibleLimits, design_excitation, excitation_dict, limits_of
from scara_ident.excitation.clearance import REACH, clearance_of
from scara_ident.excitation.verification import Reached
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot
from tests.arms import Link, example_urdf, write_urdf

ENDS = np.full(3, -2.0), np.full(3, 2.0)
BALL = '<sphere radius="0.05"/>'


def upright(folder, *shapes: str):
    """Three links in a vertical plane, each 0.4 m long with its shape in the middle, lying along x at zero."""
    links = [
        Link(axis=(0.0, 1.0, 0.0), xyz=(0.4 * bool(k), 0.0, 0.0), com=(0.2, 0.0, 0.0), shape=shape)
        for k, shape in enumerate(shapes)
    ]
    return load_robot(write_urdf(folder / "arm.urdf", links))


def middle(q, link: int):
    """x and z of the middle of a link, (2, N)."""
    angle = np.cumsum(q, axis=0)
    lengths = [0.4] * link + [0.2]
    return sum(r * np.array([np.cos(angle[k]), -np.sin(angle[k])]) for k, r in enumerate(lengths))


def drawn(count: int = 40):
    return np.random.default_rng(0).uniform(-2.0, 2.0, (3, count))


def slopes_by_difference(clearance, q, step=1e-6):
    found = [
        (clearance.nearest(q + step * unit[:, None]).distance - clearance.nearest(q - step * unit[:, None]).distance)
        / (2.0 * step)
        for unit in np.eye(len(q))
    ]
    return np.transpose(found, (1, 0, 2))


def test_two_spheres(tmp_path):
    clearance = clearance_of(upright(tmp_path, BALL, "", '<sphere radius="0.1"/>'), *ENDS, margin=0.02)
    assert clearance.groups == ("self",)
    assert clearance.notes == ("Links without a collision shape are not watched: l2.",)
    q = drawn()
    expected = np.linalg.norm(middle(q, 2) - middle(q, 0), axis=0) - 0.15
    near = clearance.nearest(q)
    np.testing.assert_allclose(near.distance[0], expected, atol=1e-12)
    np.testing.assert_allclose(clearance.slopes(q, near), slopes_by_difference(clearance, q), atol=1e-7)
    assert clearance.smallest(q, "self") == pytest.approx(expected.min(), abs=1e-12)
    # Copies measure the same.
    assert pickle.loads(pickle.dumps(clearance)).smallest(q, "self") == clearance.smallest(q, "self")


def test_a_box_over_the_floor(tmp_path):
    robot = upright(tmp_path, "", "", '<box size="0.4 0.06 0.1"/>')
    clearance = clearance_of(robot, *ENDS, margin=0.02, floor=-1.3)
    q = drawn()
    angle = q.sum(axis=0)
    lowest = middle(q, 2)[1] - 0.2 * np.abs(np.sin(angle)) - 0.05 * np.abs(np.cos(angle))
    near = clearance.nearest(q)
    np.testing.assert_allclose(near.distance, [lowest + 1.3], atol=1e-9)
    np.testing.assert_allclose(clearance.slopes(q, near), slopes_by_difference(clearance, q), atol=1e-6)
    # Rows are 1 at the margin, and 0 where there is room.
    near = clearance.nearest(q, clearance.reach)
    np.testing.assert_allclose(
        clearance.rows(near), [np.clip(1.0 - (lowest + 1.3 - 0.02) / REACH, 0.0, None)], atol=1e-7
    )


def test_what_is_passed_over_along_a_motion_changes_nothing(tmp_path):
    links = [Link(kind="prismatic", com=(0.0, 0.0, 0.0), shape=BALL)]
    links += [Link(axis=(0.0, 1.0, 0.2 * k), xyz=(0.3, 0.0, 0.0), com=(0.15, 0.0, 0.0), shape=BALL) for k in range(3)]
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", links))
    ends = np.full(4, 2.5)
    boxes = [((0.5, 0.1, 0.4), (0.1, 0.2, 0.1))]
    clearance = clearance_of(robot, -ends, ends, margin=0.01, floor=-0.3, boxes=boxes)
    assert clearance.groups == ("self", "floor", "box1")
    q = 2.4 * np.sin(np.linspace(0.0, 6.0, 400) * np.array([[0.2], [1.1], [0.7], [1.6]]) + 0.3)
    each = clearance.all_distances(q)
    groups = [[pair[2] == group for pair in clearance.pairs] for group in clearance.groups]
    least = np.array([each[own].min(axis=0) for own in groups])
    for reach in (np.inf, 0.06):
        found = clearance.nearest(q, reach).distance
        np.testing.assert_allclose(found[least > 0.0], np.minimum(least, reach)[least > 0.0], atol=1e-9)
    assert np.mean(least < 0.06) > 0.05


def test_distances_do_not_depend_on_what_was_measured_before():
    robot = load_robot(example_urdf("ur5_robot.urdf"))
    clearance = clearance_of(robot, np.full(6, -3.0), np.full(6, 3.0), margin=0.02, floor=0.0)
    q = np.random.default_rng(0).uniform(-3.0, 3.0, (6, 40))
    forward, backward = clearance.all_distances(q), clearance.all_distances(q[:, ::-1])[:, ::-1]
    np.testing.assert_array_equal(forward, backward)
    near = [clearance.nearest(each, 0.1) for each in (q, q[:, ::-1])]
    np.testing.assert_array_equal(near[0].distance, near[1].distance[:, ::-1])


def test_a_ball_beside_boxes(tmp_path):
    robot = upright(tmp_path, "", "", BALL)
    boxes = [((0.9, 0.0, 0.6), (0.2, 1.0, 0.4)), ((-5.0, 0.0, 0.0), (0.1, 0.1, 0.1))]
    clearance = clearance_of(robot, *ENDS, margin=0.01, boxes=boxes)
    assert clearance.groups == ("box1", "box2")
    q = drawn()
    x, z = middle(q, 2)
    out = np.maximum(np.abs([x - 0.9, z - 0.6]) - [[0.1], [0.2]], 0.0)
    outside = np.any(out > 0.0, axis=0)
    expected = np.linalg.norm(out, axis=0)[outside] - 0.05
    np.testing.assert_allclose(clearance.nearest(q).distance[0, outside], expected, atol=1e-7)


def test_what_touches_in_any_case_is_left_out_and_said(tmp_path):
    robot = upright(tmp_path, '<sphere radius="0.9"/>', BALL, BALL)
    clearance = clearance_of(robot, *ENDS, margin=0.02, floor=0.5)
    assert clearance.pairs == ((1, 3, "floor"), (2, 3, "floor"))
    (note,) = clearance.notes
    assert note.startswith("Not kept 0.02 m apart, as they touch") and note.endswith(": l1 and floor; l1 and l3.")


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
    np.testing.assert_allclose(clearance.nearest(q).distance[0], expected, atol=1e-9)


def test_an_arm_without_shapes_or_with_lost_ones_says_so(tmp_path):
    bare = clearance_of(upright(tmp_path, "", "", ""), *ENDS, margin=0.02, floor=0.0)
    assert bare.groups == () and "arm.urdf has no collision shapes; rehearse" in bare.notes[0]
    lost = clearance_of(upright(tmp_path, "", "", '<mesh filename="package://gone/l3.stl"/>'), *ENDS, margin=0.02)
    assert lost.groups == () and "link l3: mesh package://gone/l3.stl is not found" in lost.notes[0]
    near = clearance_of(upright(tmp_path, "", BALL, BALL), *ENDS, margin=0.02)
    assert near.groups == () and "hang on one another" in near.notes[0]
    robot = upright(tmp_path, "", "", "")
    with pytest.raises(UsageError, match="boxes: Collisions were not looked for"):
        limits_of(robot, boxes=[((1.0, 0.0, 0.0), (0.1, 0.1, 0.1))])
    with pytest.raises(UsageError, match="boxes without a clearance"):
        limits_of(robot, clearance=None, boxes=[((1.0, 0.0, 0.0), (0.1, 0.1, 0.1))])
    with pytest.raises(UsageError, match="clearance -1 m"):
        clearance_of(robot, *ENDS, margin=-1.0)
    with pytest.raises(UsageError, match="edges above 0"):
        clearance_of(robot, *ENDS, margin=0.0, boxes=[((1.0, 0.0, 0.0), (0.1, 0.0, 0.1))])


def test_a_design_keeps_its_distances_and_states_them(tmp_path):
    robot = upright(tmp_path, "", "", BALL)
    limits = limits_of(robot, share=1.0, clearance=0.1, boxes=[((0.8, 0.0, -0.55), (0.4, 0.4, 0.4))])
    made = design_excitation(
        build_model(robot, "basic"), duration=2.0, harmonics=3, samples=100, limits=limits,
        effort=Effort(starts=1, rounds=0, processes=1),
    )  # fmt: skip
    told = {each.name: each for each in made.reached}["distance.box1"]
    assert told.kept and told.bound == 0.1
    q = made.trajectories[0].at(np.linspace(0.0, 2.0, 10 * made.verified))[0]
    x, z = middle(q, 2)
    out = np.linalg.norm(np.maximum(np.abs([x - 0.8, z + 0.55]) - 0.2, 0.0), axis=0) - 0.05
    assert out.min() >= 0.1
    assert told.reached == pytest.approx(out.min(), abs=1e-4)
    content = excitation_dict(made)
    assert content["distances"] == {"box1": told.reached} and content["clearance"] == 0.1
    assert content["obstacles"]["boxes"] == [{"centre": [0.8, 0.0, -0.55], "edges": [0.4, 0.4, 0.4]}]
    assert isinstance(told, Reached)


def test_a_posture_without_room_is_said(tmp_path):
    robot = upright(tmp_path, "", "", BALL)
    limits = limits_of(robot, clearance=0.02, boxes=[((1.0, 0.0, 0.0), (0.2, 0.2, 0.2))])
    with pytest.raises(
        InfeasibleLimits, match=r"at the start, even at rest: l3 comes within -.* m of box1, where 0\.02 m"
    ):
        design_excitation(build_model(robot, "basic"), limits=limits, start=np.zeros(3))
