"""Distances of links to one another, to a floor and to boxes against closed forms."""

import pickle

import numpy as np
import pytest

from scara_ident.excitation import Effort, InfeasibleLimits, design_excitation, excitation_dict, limits_of
from scara_ident.excitation.clearance import WATCHED_DISTANCE
from scara_ident.excitation.verification import Reached
from scara_ident.excitation.watched_pairs import clearance_of
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot
from tests.arms import Link, example_urdf, write_urdf
from tests.excitation.made import BALL, ENDS, drawn, middle, upright


def by_difference(q, value, step=1e-6):
    """Differentiate what has one value at each posture by the joints, (..., n, N)."""
    found = [
        (value(q + step * unit[:, None]) - value(q - step * unit[:, None])) / (2.0 * step) for unit in np.eye(len(q))
    ]
    return np.moveaxis(np.array(found), 0, -2)


def test_two_spheres(tmp_path):
    clearance = clearance_of(upright(tmp_path, BALL, "", '<sphere radius="0.1"/>'), *ENDS, margin=0.02)
    assert clearance.groups == ("self",)
    assert clearance.notes == ("Links without a collision shape are not checked: l2.",)
    q = drawn()
    expected = np.linalg.norm(middle(q, 2) - middle(q, 0), axis=0) - 0.15
    near = clearance.nearest(q, np.inf)
    np.testing.assert_array_equal(near.place, np.arange(40))
    np.testing.assert_allclose(near.distance, expected, atol=1e-12)
    slopes = by_difference(q, lambda q: clearance.nearest(q, np.inf).distance)
    np.testing.assert_allclose(clearance.gradients(q, near).T, slopes, atol=1e-7)
    assert clearance.smallest(q, "self") == pytest.approx(expected.min(), abs=1e-12)
    # Copies measure the same.
    assert pickle.loads(pickle.dumps(clearance)).smallest(q, "self") == clearance.smallest(q, "self")


def test_a_box_over_the_floor(tmp_path):
    robot = upright(tmp_path, "", "", '<box size="0.4 0.06 0.1"/>')
    clearance = clearance_of(robot, *ENDS, margin=0.02, floor=-1.3)
    q = drawn()
    angle = q.sum(axis=0)
    lowest = middle(q, 2)[1] - 0.2 * np.abs(np.sin(angle)) - 0.05 * np.abs(np.cos(angle))
    near = clearance.nearest(q, np.inf)
    np.testing.assert_allclose(near.distance, lowest + 1.3, atol=1e-9)
    slopes = by_difference(q, lambda q: clearance.nearest(q, np.inf).distance)
    np.testing.assert_allclose(clearance.gradients(q, near).T, slopes, atol=1e-6)
    # Rows are 1 at the margin, and 0 where there is room.
    near = clearance.nearest(q, clearance.reach)
    np.testing.assert_allclose(
        clearance.rows(near, 40), [np.clip(1.0 - (lowest + 1.3 - 0.02) / WATCHED_DISTANCE, 0.0, None)], atol=1e-7
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
    for reach in (np.inf, 0.06):
        found = clearance.nearest(q, reach)
        for group, own in zip(clearance.groups, groups, strict=True):
            chosen = np.array(own)[found.pair]
            least = np.full(400, reach)
            np.minimum.at(least, found.place[chosen], found.distance[chosen])
            expected = each[own].min(axis=0)
            apart = expected > 0.0
            np.testing.assert_allclose(least[apart], np.minimum(expected, reach)[apart], atol=1e-9, err_msg=group)
    assert np.mean(each.min(axis=0) < 0.06) > 0.05


def test_pairs_count_together_and_smoothly(tmp_path):
    """Two balls over a floor: less room than the lower of them has, none where it has none, and no bend where they swap."""
    clearance = clearance_of(upright(tmp_path, "", BALL, BALL), *ENDS, margin=0.02, floor=-0.3)
    lift = np.linspace(0.2, 0.7, 2001)
    # The last two links are about level.
    q = np.array([lift, 0.1 * np.sin(40.0 * lift) - lift, 0.1 * np.cos(26.0 * lift)])
    heights = np.array([middle(q, 1)[1], middle(q, 2)[1]]) + 0.3 - 0.05
    near = clearance.nearest(q, clearance.reach)
    row, room = clearance.rows(near, 2001)[0], (heights - 0.02) / WATCHED_DISTANCE
    free = room.min(axis=0) > 0.0
    swaps = np.flatnonzero(np.diff(np.sign(room[0] - room[1])) * free[1:])
    assert np.any(room[:, swaps] < 1.0) and np.any(~free) and np.any(room.min(axis=0) > 1.0)
    least = np.minimum(room.min(axis=0), 1.0)
    assert np.all(row >= 1.0 - least - 1e-12) and np.all((row >= 1.0) == (least <= 0.0))
    np.testing.assert_allclose(row[~free], 1.0 - least[~free], atol=1e-9)
    inside = free & np.all(room < 1.0, axis=0)
    slopes = by_difference(q[:, inside], lambda q: clearance.rows(clearance.nearest(q, clearance.reach), q.shape[1]))
    found = clearance.slopes(q[:, inside], clearance.nearest(q[:, inside], clearance.reach))
    np.testing.assert_allclose(found, slopes, atol=1e-5 * np.abs(found).max())
    # Too near the nearest alone tells which way there is more room, but where another takes its place.
    broken = q[:, ~free & (np.abs(room[0] - room[1]) > 1e-3)]
    slopes = by_difference(broken, lambda q: clearance.rows(clearance.nearest(q, clearance.reach), q.shape[1]))
    found = clearance.slopes(broken, clearance.nearest(broken, clearance.reach))
    np.testing.assert_allclose(found, slopes, atol=1e-5 * np.abs(found).max())


def test_distances_do_not_depend_on_what_was_measured_before():
    robot = load_robot(example_urdf("ur5_robot.urdf"))
    clearance = clearance_of(robot, np.full(6, -3.0), np.full(6, 3.0), margin=0.02, floor=0.0)
    q = np.random.default_rng(0).uniform(-3.0, 3.0, (6, 40))
    forward, backward = clearance.all_distances(q), clearance.all_distances(q[:, ::-1])[:, ::-1]
    np.testing.assert_array_equal(forward, backward)
    near = [clearance.nearest(each, 0.1) for each in (q, q[:, ::-1])]
    found = [
        sorted(zip(place, each.pair, each.distance, strict=True))
        for place, each in zip((near[0].place, 39 - near[1].place), near, strict=True)
    ]
    assert found[0] == found[1] and len(found[0]) > 40


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
    near = clearance.nearest(q, np.inf)
    found = near.distance[near.pair == 0]
    np.testing.assert_allclose(found[outside], expected, atol=1e-7)


@pytest.mark.slow
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
