"""Scenes at an estimate of a model with effects: what is known of those that act on links."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_array_equal

from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.fitting.at_estimate import at_estimate, estimate_of, moved_with, without_others
from scara_ident.effects import Member
from scara_ident.effects.friction import Stribeck
from scara_ident.effects.gear import TransmissionLoss
from scara_ident.effects.payload import FreePayloadChange
from scara_ident.effects.position import Spring
from scara_ident.robot.robot import load_robot
from tests.effects.scenes import scene_of

SCENE = scene_of(load_robot())
BODY = Candidate(FreePayloadChange(), Member(None, (2.0,)))
SPRING = Candidate(Spring(), Member(1))
CHOSEN = (Candidate(Stribeck(), Member(0, (0.1,))), BODY, Candidate(TransmissionLoss(), Member(1, (0.1,))), SPRING)
SIZES = [len(item.effect.columns(SCENE, item.member)) for item in CHOSEN]
VALUE = np.concatenate([SCENE.value + 1.0, np.arange(1.0, 1.0 + sum(SIZES))])


def test_it_knows_the_base_model_and_what_acts_on_links_and_gives_it_back():
    scene = at_estimate(SCENE, CHOSEN, VALUE)
    assert_array_equal(scene.value, SCENE.value + 1.0)
    assert [(item.effect, item.member) for item in scene.link_torques] == [
        (BODY.effect, BODY.member),
        (SPRING.effect, SPRING.member),
    ]
    assert scene.link_torques[0].value == tuple(np.arange(2.0, 2.0 + SIZES[1]).tolist())
    assert scene.link_torques[1].value == (float(sum(SIZES)),)
    # Of the others no column follows how large they are.
    known = np.concatenate([np.zeros(1), np.arange(2.0, 2.0 + SIZES[1]), np.zeros(1), [float(sum(SIZES))]])
    assert_array_equal(estimate_of(scene, CHOSEN), np.concatenate([SCENE.value + 1.0, known]))


def test_a_torque_that_follows_from_the_load_is_no_part_of_it():
    class Swinging(Spring):
        def geared_joint(self, member):
            return member.place

    scene = at_estimate(SCENE, (Candidate(Swinging(), Member(0)), SPRING), np.append(SCENE.value, [1.0, 2.0]))
    assert [(item.effect, item.value) for item in scene.link_torques] == [(SPRING.effect, (2.0,))]


def test_an_effect_that_has_just_come_in_is_none_yet():
    scene = at_estimate(SCENE, CHOSEN[:1], VALUE[: len(SCENE.value) + 1])
    assert scene.link_torques == ()
    assert_array_equal(estimate_of(scene, (SPRING,))[-1:], [0.0])


def test_one_that_is_no_longer_in_the_model_is_forgotten():
    scene = at_estimate(SCENE, CHOSEN, VALUE)
    assert without_others(scene, CHOSEN) is scene
    left = without_others(scene, (CHOSEN[2], SPRING))
    assert [item.effect for item in left.link_torques] == [SPRING.effect]
    assert left.value is scene.value


def test_one_that_acts_at_another_time_keeps_its_size():
    scene, later = at_estimate(SCENE, CHOSEN, VALUE), BODY.at([3.0])
    moved = moved_with(scene, CHOSEN, (CHOSEN[0], later, *CHOSEN[2:]))
    assert [item.member for item in moved.link_torques] == [later.member, SPRING.member]
    assert [item.value for item in moved.link_torques] == [item.value for item in scene.link_torques]
    assert moved_with(SCENE, CHOSEN, CHOSEN) is SCENE
