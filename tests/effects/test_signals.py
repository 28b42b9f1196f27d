"""Signals of a stretch of motion, and what a scene says of the rotors."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.effects import Signals
from scara_ident.robot.robot import load_robot
from tests.arms import Link, example_urdf, rnea, write_urdf
from tests.effects.carried import carrying, heavier
from tests.effects.scenes import moving, scene_of


def test_signs_are_those_of_the_drive_and_angles_those_of_the_motor():
    robot = load_robot()
    turned = replace(robot, reduction=robot.reduction * np.array([1.0, -1.0]))
    item = moving(turned, 0.2)
    signals = Signals(scene_of(turned), item)
    assert np.array_equal(signals.sign[1], -np.sign(item.v[1]))
    assert signals.motor_turns == pytest.approx(turned.reduction[:, None] * item.q)


def test_time_begins_with_the_recording_or_with_the_stretch():
    item = moving(load_robot(), 0.2)
    late = replace(item, time=item.time + 5.0)
    assert Signals(scene_of(load_robot(), start={"m": 3.0}), late).time[0] == 2.0
    assert Signals(scene_of(load_robot(), start={"other": 3.0}), late).time[0] == 0.0


def test_the_load_is_the_rigid_torque_without_the_own_rotor():
    robot = load_robot()
    scene, item = scene_of(robot), moving(robot, 0.2)
    links = rnea(robot, item.q, item.v, item.a) * robot.row_scale[:, None]
    signals = Signals(scene, item)
    # The armature of joint 2 is a base parameter, that of joint 1 is nominal and hides in the first link.
    assert signals.load(1) == pytest.approx(links[1], abs=1e-9)
    assert signals.load(0) == pytest.approx(links[0], abs=1e-9)
    friction = signals.predicted - signals.rigid
    v = item.v
    assert friction == pytest.approx(0.02 * (np.sign(v) * (1.0 + v**2) + v + v**3 + 1.0), abs=1e-12)


def test_a_torque_swings_by_what_is_beyond_the_low_pass_of_the_positions():
    robot = load_robot()
    item = moving(robot, 4.0)
    slow, fast = (np.outer([1.0, 2.0], np.sin(2.0 * np.pi * f * item.time)) for f in (2.0, 100.0))
    signals = Signals(scene_of(robot), replace(item, cuts=(15.0, None)).with_torque(slow + fast))
    assert np.max(np.abs(signals.swing(0) - fast[0])[100:-100]) < 1e-3
    assert np.array_equal(signals.swing(1), np.zeros(item.samples))
    assert signals.at(scene_of(robot, 1.1 * signals.scene.value)).swing(0) is signals.swing(0)
    assert np.array_equal(Signals(scene_of(robot), item).swing(0), np.zeros(item.samples))


def test_an_armature_is_what_the_model_tells_else_what_an_effect_determined_else_nominal():
    scene = scene_of(load_robot())
    nominal = scene.robot.reduction**2 * scene.robot.rotor_inertia
    assert scene.known_armature(0) is None
    assert scene.armature(0) == pytest.approx(nominal[0])
    assert replace(scene, armatures={0: 0.7, 1: 0.7}).armature(0) == 0.7
    assert replace(scene, armatures={0: 0.7, 1: 0.7}).armature(1) == scene.known_armature(1)
    assert scene.known_armature(1) == pytest.approx(nominal[1])


@pytest.mark.parametrize(("arm", "mass"), [("scara03", 0.4), ("scara03", 3.0), ("ur5", 1.0), ("ur5", -0.5)])
def test_a_gear_transmits_what_the_effects_in_the_model_do_to_links_as_if_the_bodies_had_it(arm: str, mass: float):
    robot = load_robot() if arm == "scara03" else load_robot(example_urdf("ur5_robot.urdf"))
    item, empty = moving(robot, 0.5), Signals(scene_of(robot), moving(robot, 0.5))
    carried, merged = Signals(carrying(scene_of(robot), mass), item), Signals(heavier(robot, mass), item)
    for joint in range(robot.n):
        assert carried.load(joint) == pytest.approx(merged.load(joint), abs=1e-9)
    assert np.max(np.abs(carried.load(1) - empty.load(1))) > 1e-3 * np.max(np.abs(empty.load(1)))
    # The base model says what it said.
    assert np.array_equal(carried.rigid, empty.rigid)
    assert np.array_equal(empty.on_links, np.zeros_like(item.q))


def test_signals_at_another_estimate_of_what_acts_on_links_have_another_load():
    robot = load_robot()
    scene = carrying(scene_of(robot), 1.0)
    first = Signals(scene, moving(robot, 0.2))
    load = first.load(1)
    other = first.at(replace(scene, link_torques=carrying(scene, 2.0).link_torques))
    assert other.rigid is first.rigid
    # Another armature leaves it as it is.
    assert first.at(replace(scene, armatures={0: 1.0})).on_links is first.on_links
    assert other.load(1) == pytest.approx(load + first.on_links[1], abs=1e-9)


def test_a_length_goes_by_what_a_slide_travels_and_by_its_range_where_it_stands_still(tmp_path):
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", [Link(), Link("prismatic"), Link("prismatic")]))
    scene = replace(scene_of(robot), travel=np.array([2.0, 0.05, 1e-6]))
    # The limits of these arms are 3 m to either side.
    assert scene.radian == pytest.approx([1.0, 0.05 / np.pi, 6.0 / np.pi])
