"""Rigid bodies under another gravity, payload or position, against Pinocchio."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_array_equal

from scara_ident.effects import CATALOGUE, Effect, Member, Signals
from scara_ident.effects.gravity import first_moments, gravity_columns
from scara_ident.effects.links import (
    guessed_armatures,
    lagging,
    lagging_at,
    largest_armature,
    link_inertia,
    link_slopes,
    on_links_at,
    point_mass,
    rigid_slopes,
    rigid_torque,
    shared,
    tool_of,
    usual_link_inertia,
)
from scara_ident.effects.signals import ModelledEffect
from scara_ident.effects.tilt import NominalBaseTilt
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import example_urdf, rnea
from tests.effects.carried import carrying, heavier
from tests.effects.scenes import moving, scene_of
from tests.effects.test_position import lift


def test_the_tool_of_the_scara_is_at_the_end_of_its_second_link():
    tool = tool_of(load_robot())
    assert tool.joint == 1
    assert tool.point[:2] == pytest.approx([0.33, 0.0])


@pytest.mark.parametrize("name", ["scara03", "ur5"])
def test_a_lagging_link_loads_all_joints_as_pinocchio_says(name: str):
    robot = load_robot() if name == "scara03" else load_robot(example_urdf("ur5_robot.urdf"))
    scene, item = scene_of(robot), moving(robot, 1.0)
    joint, w = 1, 30.0
    lag = (1e-3 * np.sin(w * item.time), 1e-3 * w * np.cos(w * item.time), -1e-3 * w**2 * np.sin(w * item.time))
    signals = Signals(scene, item)
    changed = lagging(signals, joint, lag)
    assert_array_equal(lagging_at(signals, joint, joint, lag), changed[joint])
    twice = lagging_at(signals, joint, joint, tuple(np.array([part[:9], 2.0 * part[:9]]) for part in lag))
    assert twice == pytest.approx(np.outer([1.0, 2.0], np.ones(9)) * changed[joint, :9])
    size = 1e-3
    ends = []
    for side in (1.0, -1.0):
        moved = [part.copy() for part in (item.q, item.v, item.a)]
        for part, change in zip(moved, lag, strict=True):
            part[joint] -= side * size * change
        ends.append(rnea(robot, *moved))
    expected = (ends[0] - ends[1]) / (2.0 * size) * robot.row_scale[:, None]
    assert np.abs(changed - expected).max() < 1e-3 * np.abs(expected).max()


def test_inertia_of_the_link_is_the_mass_matrix_without_the_rotor():
    robot = load_robot()
    scene, item = scene_of(robot), moving(robot, 0.1)
    data = robot.model.createData()
    expected = [pin.crba(robot.model, data, item.q[:, k])[0, 0] for k in range(item.samples)]
    assert link_inertia(Signals(scene, item), 0) == pytest.approx(expected)
    assert 2.0 < usual_link_inertia(scene, 0) < 4.0


def test_a_point_mass_has_the_parameters_of_pinocchio():
    point = np.array([0.3, -0.2, 0.5])
    assert point_mass(point) == pytest.approx(pin.Inertia(1.0, point, np.zeros((3, 3))).toDynamicParameters())


def test_what_members_share_is_made_once_per_stretch():
    scene, item = scene_of(load_robot()), moving(load_robot(), 0.02)
    made = []

    def make():
        made.append(1)
        return np.zeros(1)

    one, two = Signals(scene, item), Signals(scene, item)
    for signals in (one, one, two):
        shared(signals, "key", make)
    assert len(made) == 2


def unstated(robot: Robot) -> Robot:
    return replace(robot, rotor_stated=np.zeros(robot.n, dtype=bool))


def test_a_rotor_that_nobody_stated_begins_as_guessed_within_what_the_estimate_leaves_room_for():
    robot = load_robot()
    stated = scene_of(robot)
    scene = scene_of(unstated(robot), stated.value)
    # The second rotor is told by the base model, and needs no guess.
    assert guessed_armatures(stated) == {}
    assert guessed_armatures(scene) == {0: scene.nominal_armature(0)}
    assert scene.nominal_armature(0) == robot.rotor_guess.armature[0]
    room = largest_armature(scene, 0)
    assert robot.rotor_guess.armature[0] < 0.5 * room
    heavy = replace(robot, effort_limit=50.0 * robot.effort_limit)
    assert guessed_armatures(scene_of(unstated(heavy), stated.value)) == {0: 0.5 * room}


def test_the_largest_armature_leaves_the_link_nothing_where_it_is_folded():
    scene = scene_of(load_robot())
    q = np.zeros((2, 200))
    q[1] = np.linspace(-np.pi, np.pi, 200)
    rest, pushed = np.zeros_like(q), np.array([np.ones(200), np.zeros(200)])
    moved = (rigid_torque(scene, item_at(q), q, rest, pushed) - rigid_torque(scene, item_at(q), q, rest, rest))[0]
    moved /= scene.robot.row_scale[0]
    assert moved.min() <= largest_armature(scene, 0) < moved.min() + 0.05 * (moved.max() - moved.min())
    # A negative inertia is a poor estimate, which bounds nothing.
    assert largest_armature(replace(scene, value=-scene.value), 0) == np.inf


def item_at(q: np.ndarray) -> Motion:
    rest = np.zeros_like(q)
    return Motion("m", "m", np.arange(q.shape[1]) / 100.0, q, rest, rest, None, 100.0)


@pytest.mark.parametrize("name", ["scara03", "ur5"])
def test_what_acts_on_links_lags_with_them_as_if_the_bodies_had_it(name: str):
    robot = load_robot() if name == "scara03" else load_robot(example_urdf("ur5_robot.urdf"))
    item, joint = moving(robot, 0.5), 1
    carried, merged = (Signals(scene, item) for scene in (carrying(scene_of(robot), 1.5), heavier(robot, 1.5)))
    for found, expected in zip(link_slopes(carried, joint), rigid_slopes(merged, joint), strict=True):
        # Differences by position err by the torque's rounding over twice the step of 1e-5.
        assert found == pytest.approx(expected, rel=1e-6, abs=1e-6 * np.max(np.abs(expected)))
    assert link_slopes(merged, joint) is rigid_slopes(merged, joint)
    assert link_inertia(carried, joint) == pytest.approx(link_inertia(merged, joint), rel=1e-6)
    state = item.q + 0.1, item.v, item.a
    expected = rigid_torque(merged.scene, item, *state) - rigid_torque(carried.scene, item, *state)
    assert on_links_at(carried, *state) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize("effect", [x for x in CATALOGUE if x.of_position], ids=lambda item: type(item).__name__)
def test_a_torque_that_is_of_the_position_knows_no_speed(effect: Effect, tmp_path: Path):
    assert effect.on_links
    # No joint of a UR5 goes up and down.
    robot = lift(tmp_path) if effect.name == "rope_weight" else load_robot(example_urdf("ur5_robot.urdf"))
    scene, item, other = scene_of(robot), moving(robot, 0.1), moving(robot, 0.1, seed=3)
    members = effect.members(scene)
    assert members
    for member in members:
        value = np.ones(len(effect.columns(scene, member)))
        moved = replace(item, v=other.v, a=other.a)
        here, there = (effect.torque_on_links(Signals(scene, each), member, value) for each in (item, moved))
        assert_array_equal(here, there)


def test_what_a_leaning_base_does_to_links_changes_with_their_positions_alone():
    robot = load_robot(example_urdf("ur5_robot.urdf"))
    scene, item, joint = scene_of(robot), moving(robot, 0.2), 2
    tilt = ModelledEffect(NominalBaseTilt(), Member(None, (1.0,)), (0.02, -0.03))
    leaning = replace(scene, link_torques=(tilt,))
    rigid, found = (link_slopes(Signals(each, item), joint) for each in (scene, leaning))
    ends = []
    for step in (1e-4, -1e-4):
        q = item.q.copy()
        q[joint] += step
        columns = np.array([gravity_columns(robot, axis, q) for axis in range(2)])
        moments = robot.standard_parameters()[first_moments(robot)]
        ends.append(np.einsum("a,ajkn,k->jn", [0.02, -0.03], columns, moments))
    expected = (ends[0] - ends[1]) / 2e-4
    assert found[0] - rigid[0] == pytest.approx(expected, abs=1e-4 * np.abs(expected).max())
    assert_array_equal(found[1], rigid[1])
    assert_array_equal(found[2], rigid[2])
