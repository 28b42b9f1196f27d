"""A shaft through two joints: its power, the parts that the links' inertia spans, and when it is not named."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.effects import Member
from scara_ident.effects.shaft import CoupledShaft
from scara_ident.robot.robot import load_robot
from tests.arms import example_urdf
from tests.effects.scenes import columns, moving, scene_of

WAYS = pytest.mark.parametrize(("effect", "side"), [(CoupledShaft(), 1.0), (CoupledShaft("difference"), -1.0)])


@WAYS
def test_its_torque_does_the_work_of_what_turns_with_both_joints(effect: CoupledShaft, side: float):
    robot = load_robot(example_urdf("ur5_robot.urdf"))
    scene, item = scene_of(robot), moving(robot, 1.0)
    found = columns(effect, scene, item, Member(4, (), 5)) / robot.row_scale[:, None, None]
    turn, speed_up = (part[4] + side * part[5] for part in (item.v, item.a))
    power = np.einsum("jkn,jn->kn", found, item.v)
    assert power == pytest.approx(np.array([speed_up * turn, turn**2, np.abs(turn)]), abs=1e-9)
    assert not np.any(found[:4])


@WAYS
def test_about_parallel_axes_the_links_span_its_inertia(effect: CoupledShaft, side: float):
    robot = load_robot()
    scene, item = scene_of(robot), moving(robot, 0.2)
    (member,) = effect.members(scene)
    assert [column.name for column in effect.columns(scene, member)] == ["viscous", "coulomb"]
    found = columns(effect, scene, item, member)
    turn = item.v[0] + side * item.v[1]
    assert found[:, 0] == pytest.approx(np.outer([1.0, side] * robot.row_scale, turn))
    assert effect.inadmissible(scene, member, np.array([0.3, 0.2]), np.array([0.01, 0.01])) is None


def test_it_is_named_only_where_friction_is_seen():
    scene, effect = scene_of(load_robot(example_urdf("ur5_robot.urdf"))), CoupledShaft()
    member, std = Member(4, (), 5), np.full(3, 0.01)
    assert effect.inadmissible(scene, member, np.array([0.1, 0.2, 0.0]), std) is None
    # A short run tells the friction well before the inertia.
    assert effect.inadmissible(scene, member, np.array([0.02, 0.2, 0.3]), std) is None
    assert "no friction" in str(effect.inadmissible(scene, member, np.array([0.1, 0.0, 0.02]), std))
    assert "would push" in str(effect.inadmissible(scene, member, np.array([0.1, 0.2, -0.1]), std))


def test_neighbours_are_tried_in_words_that_say_which_way():
    scene = scene_of(load_robot(example_urdf("ur5_robot.urdf")))
    members = CoupledShaft().members(scene)
    assert [(member.joint, member.partner) for member in members] == [(k, k + 1) for k in range(5)]
    words = [CoupledShaft(way).description(scene, members[4]) for way in ("sum", "difference")]
    assert words[0] == "a shaft that turns with wrist_2_joint and wrist_3_joint"
    assert words[1] == "a shaft that turns with the difference of wrist_2_joint and wrist_3_joint"
    assert [column.unit for column in CoupledShaft().columns(scene, members[4])] == ["kg m^2", "N m s/rad", "N m"]
