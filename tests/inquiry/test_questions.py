"""What a diagnosis leaves open."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis import Unexplained
from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.effects import Member
from scara_ident.effects.filters.torque_filter import TorqueFilter
from scara_ident.errors import UsageError
from scara_ident.files import plain
from scara_ident.inquiry.questions import (
    MAX_ODDS,
    Suspect,
    odds_of,
    question_of,
    questions,
    suspect_of,
    suspects_in_model,
)
from tests.inquiry.asked import PAIR, coarse_diagnosis, open_diagnosis


def test_an_effect_that_may_be_another_is_asked_for_first():
    first = questions(open_diagnosis())[0]
    assert first.kind == "confounders" and first.text == PAIR
    spring, tilt = first.suspects
    assert spring == suspects_in_model(open_diagnosis())[0]
    # Both are of a size that the recordings have: the tilt's gravity for the spring's torque.
    assert abs(spring.value[0]) == pytest.approx(0.08, rel=0.2) and len(tilt.value) > 1


def test_a_remainder_is_asked_for_over_its_signals():
    left = Unexplained("joint2", ("position of joint2",), 0.03, 0.5)
    second = questions(replace(open_diagnosis(), unexplained=left))[1]
    assert (second.kind, second.joint, second.signals, second.size) == ("unexplained", "joint2", left.signals, 0.03)


def test_questions_are_the_same_from_a_file():
    for question in questions(open_diagnosis()):
        again = question_of(json.loads(json.dumps(plain(question.entry()))))
        assert plain(again.entry()) == plain(question.entry())
        assert again.suspects == question.suspects


def test_an_effect_of_a_file_that_is_not_installed_is_said():
    entry = questions(open_diagnosis())[0].entry()
    entry["suspects"][0]["effect"] = "gremlin"
    with pytest.raises(UsageError, match="gremlin"):
        question_of(entry)


def test_a_p_value_speaks_for_an_effect_as_much_as_it_can():
    # Table 1 of Sellke, Bayarri and Berger 2001: odds of none of .870, .407 and .125.
    assert [1.0 / odds_of(p) for p in (0.2, 0.05, 0.01)] == pytest.approx([0.870, 0.407, 0.125], abs=6e-3)
    assert odds_of(0.9) == pytest.approx(1.0) and odds_of(0.0) == odds_of(1e-30) == MAX_ODDS
    # What cannot be there as it was found may be there with the other sign, and nothing speaks for it.
    found = open_diagnosis()
    (decision,) = [item for item in found.search.decisions if item.label == "spring of joint2"][:1]
    pushing = replace(decision, examination=replace(decision.examination, value=np.array([-1.0]), p_value=1e-3))
    asked = questions(replace(found, search=replace(found.search, decisions=(pushing,))))
    (spring,) = [item for question in asked for item in question.suspects if item.label == "spring of joint2"]
    assert spring.value[0] > 0.0 and spring.odds == pytest.approx(1.0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_what_the_noise_of_positions_makes_does_not_rank_first(seed: int):
    found = coarse_diagnosis(seed)
    assert min(item.examination.p_value for item in found.search.decisions) < 1e-5
    suspects = [item for question in questions(found) for item in question.suspects]
    assert {item.label for item in suspects} == {"joint_elasticity of joint1", "joint_elasticity of joint2"}
    # Before it was taken off, as many as there can be.
    assert max(item.odds for item in suspects) < 0.25 * MAX_ODDS


def test_of_members_of_which_nothing_is_known_that_which_takes_fewest_standard_errors_is_asked_for():
    found = open_diagnosis()
    (decision,) = [item for item in found.search.decisions if item.label == "spring of joint2"][:1]
    usual = replace(decision.examination, value=np.array([0.1]), p_value=0.8, gain=0.0, freedom=12.0)
    # One block of time tells it, so that it would have to be thousands of standard errors large.
    lonely = replace(usual, value=np.array([1.0]), p_value=0.4, gain=0.2, freedom=1.04)
    likely = replace(usual, value=np.array([2.0]), p_value=1e-3, freedom=6.0)

    def asked(*examinations) -> tuple[float, ...]:
        tried = tuple(replace(decision, examination=item, gain=item.gain) for item in examinations)
        held = questions(replace(found, search=replace(found.search, decisions=tried)))
        (spring,) = [item for question in held for item in question.suspects if item.label == "spring of joint2"]
        return spring.value

    assert asked(lonely, usual) == asked(usual)
    assert asked(usual, likely, lonely) == asked(likely) != asked(usual)


def test_options_of_a_family_that_are_numbers_come_again():
    """What a delay of 3.5 ms left was asked for as what one of 10 ms leaves."""
    candidate = Candidate(TorqueFilter(0.0035), Member(None))
    entry = json.loads(json.dumps(Suspect(candidate, "torque_filter", (0.3, 0.1)).entry()))
    assert suspect_of(entry).candidate == candidate
    del entry["options"]
    assert suspect_of(entry).candidate.effect == TorqueFilter()
