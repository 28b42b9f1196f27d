"""Candidates by name, and a bank against its members one by one."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_array_equal

from scara_ident.diagnosis.candidates import Bank, Candidate
from scara_ident.effects import CATALOGUE, Member
from scara_ident.effects.friction import FrictionCoupling, Stribeck
from scara_ident.effects.tilt import BaseTilt
from scara_ident.robot.robot import load_robot
from tests.effects.scenes import moving, scene_of

ROBOT = load_robot()
SCENE = scene_of(ROBOT)


def test_a_candidate_is_called_by_effect_and_joints():
    assert Candidate(Stribeck(), Member(1, (0.1,))).label(SCENE) == "stribeck of joint2"
    assert Candidate(BaseTilt(), Member(None)).label(SCENE) == "base_tilt"
    coupling = next(item for item in FrictionCoupling().members(SCENE) if item.joint == 0)
    assert Candidate(FrictionCoupling(), coupling).label(SCENE) == "friction_coupling of joint1 by joint2"


def test_other_knobs_change_neither_joint_nor_label():
    one = Candidate(Stribeck(), Member(1, (0.1,)))
    other = one.at([np.float64(0.2)])
    assert other.member.nonlinear == (0.2,)
    assert type(other.member.nonlinear[0]) is float
    assert (other.joint(SCENE), other.label(SCENE)) == ("joint2", one.label(SCENE))


def test_members_of_the_catalogue_that_differ_in_more_than_knobs_have_their_own_labels():
    kinds: dict[str, set] = {}
    for effect in CATALOGUE:
        for member in effect.members(SCENE):
            label = Candidate(effect, member).label(SCENE)
            kinds.setdefault(label, set()).add((effect.name, member.joint))
    assert all(len(kind) == 1 for kind in kinds.values())
    assert len(kinds) > 20


def test_a_bank_is_its_members_side_by_side():
    candidates = tuple(Candidate(effect, member) for effect in CATALOGUE for member in effect.members(SCENE)[:2])
    bank = Bank(SCENE, candidates)
    item = moving(ROBOT, 1.0)
    whole = bank.regressor(item)
    assert whole.shape == (2, len(bank.columns), item.samples)
    for candidate, place in zip(candidates, bank.places, strict=True):
        alone = candidate.term(SCENE).regressor(item)
        assert_array_equal(whole[:, place], alone)
    assert not np.any(whole[~bank.pattern])


def test_an_empty_bank_has_no_columns():
    bank = Bank(SCENE, ())
    assert bank.pattern.shape == (2, 0)
    assert bank.regressor(moving(ROBOT, 0.5)).shape[1] == 0
