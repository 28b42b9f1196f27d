"""What is told to be done next."""

from __future__ import annotations

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from scara_ident.diagnosis import diagnose
from scara_ident.diagnosis.checks.noise_check import BY_NOISE
from scara_ident.diagnosis.criteria import CRITERIA
from scara_ident.effects.position import Spring
from scara_ident.inquiry.answerability import inquire
from scara_ident.inquiry.next_steps import ASKED_MOTION, capital, next_steps, with_reasons
from scara_ident.report.diagnosis import diagnosis_dict
from scara_ident.report.diagnosis_markdown import diagnosis_markdown
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, exact_runs, with_torque
from tests.inquiry.asked import PAIR, open_diagnosis

REPEAT = "record every trajectory at least twice"


@pytest.fixture(scope="module")
def lean():
    """A model that lacks nothing, on runs without repetition or validation."""
    return diagnose(load_robot(), exact_runs()[::2], bands=BANDS, catalogue=())


def test_what_the_recordings_lack_is_asked_for(lean):
    found = {item.question: item for item in next_steps(lean)}
    assert found["the noise floor"].motion == REPEAT
    length = sum(np.ptp(run.time) for run in exact_runs()[::2])
    assert found["the noise floor"].seconds == pytest.approx(length, rel=0.01)
    assert found["whether the result holds elsewhere"].motion.endswith("give it with validation")


@pytest.mark.parametrize("repeated", [False, True])
def test_a_recording_that_leaves_more_than_all_others_is_asked_for_once_more(repeated: bool):
    """A brake that dragged in one run was `undecided`, and another motion over the whole workspace the first thing to do."""
    runs = exact_runs()[:: 1 if repeated else 2]
    found, run = diagnose(load_robot(), runs, bands=BANDS, catalogue=()), runs[-1]
    evidence = (found.evidence[0], replace(found.evidence[1], shown=False, by="", apart=run.name))
    first = next_steps(replace(found, evidence=evidence))[0]
    assert first.question == f"what only {run.name} has on joint2"
    assert ("find what was different" in first.motion, first.seconds is None) == (repeated, repeated)
    assert first.seconds is None or first.seconds == pytest.approx(np.ptp(run.time), rel=0.01)


def test_they_are_found_once_for_the_file_the_report_and_the_story(monkeypatch):
    found = open_diagnosis()
    asked = []
    monkeypatch.setattr(
        sys.modules[next_steps.__module__], "inquire", lambda *given: asked.append(given) or inquire(*given)
    )
    fresh = replace(found)
    content = diagnosis_dict(fresh)
    assert diagnosis_dict(fresh)["next"] == content["next"] and next_steps(fresh) is next_steps(fresh)
    # One inquiry holds all questions: the factor of the recordings' rows is made once.
    assert len(asked) == 1 and len(asked[0][1]) == sum("kind" in item for item in content["next"])


def test_what_no_motion_settles_names_the_experiment(lean):
    found = {item.question.partition(" or ")[0]: item.motion for item in next_steps(lean)}
    assert found["constant_payload"] == "recordings with and without the payload"
    assert "drive off" in found["asymmetric_coulomb"]


def test_what_changes_no_torque_is_absorbed_by_nothing(lean):
    found = replace(lean, aliases=(replace(lean.aliases[0], effect="own", absorbed_by=()),))
    assert "own, which changes no torque" in {item.question for item in next_steps(found)}
    assert "| no torque at all |" in diagnosis_markdown(found)


def test_a_remainder_that_depends_on_a_signal_asks_for_a_motion_and_another_for_half_the_speed():
    runs = with_torque(exact_runs(), 1, lambda motion: 0.03 * np.sin(5.0 * motion.q[1]))
    found = diagnose(load_robot(), runs, bands=BANDS, catalogue=())
    first, *others = next_steps(found)
    assert first.question == "what is left on joint2, over position of joint2"
    assert first.motion == ASKED_MOTION and first.sigma_before is not None
    assert REPEAT not in [item.motion for item in others]
    bare = replace(found, unexplained=replace(found.unexplained, signals=()))
    assert "at half the speed" in next_steps(bare)[0].motion
    shown = tuple(replace(item, shown=False, by="repetition") for item in found.evidence)
    small = next_steps(replace(found, unexplained=None, evidence=shown))[0]
    assert small.question == "what is left on joint1 and joint2" and "at half the speed" in small.motion
    # Of one trajectory nobody can say what it depends on.
    (alone, *_) = next_steps(replace(bare, dependences=()))
    assert alone.question == "what is left on joint2, over position of joint2 and velocity of joint2"
    assert alone.motion == ASKED_MOTION


def test_confounders_ask_for_a_motion_and_an_effect_for_the_experiment_that_shows_it():
    first = next_steps(open_diagnosis())[0]
    entry = first.entry()
    assert {"question", "motion", "sigma_before", "sigma_after", "seconds"} <= entry.keys()
    assert entry["question"] == PAIR and entry["motion"] == ASKED_MOTION and entry["sigma_after"] is None
    assert 0.0 <= entry["sigma_before"] < 4.0 and entry["seconds"] == 15.0
    assert first.sentence().startswith(f"{PAIR[:1].upper()}{PAIR[1:]}: {ASKED_MOTION} designs a motion (15 s); ")
    runs = with_torque(exact_runs(3)[:4], 1, lambda motion: 0.05 * motion.q[1])
    found = diagnose(load_robot(), runs, bands=BANDS, catalogue=(Spring(),))
    motions = {item.question: item.motion for item in next_steps(found)}
    assert motions["to confirm spring of joint2"] == Spring().experiment


def test_each_candidate_has_its_own_reason():
    first, second = (SimpleNamespace(label=f"spring of joint{k}", why=f"reason {k}") for k in (1, 2))
    assert with_reasons([first]) == "spring of joint1, significant but not accepted (reason 1)"
    second.why = first.why
    assert with_reasons([first, second]).endswith(
        "joint1 and spring of joint2, significant but not accepted (reason 1)"
    )
    second.why = "too small"
    assert "joint1 (reason 1) and spring of joint2 (too small), significant" in with_reasons([first, second])


def test_a_sentence_begins_with_a_capital_unless_it_begins_with_a_name():
    assert capital("spring or offset") == "Spring or offset"
    assert capital("shoulder_pan_joint: friction") == "shoulder_pan_joint: friction"
    assert capital("joint1: friction") == "joint1: friction"


def test_what_noise_makes_on_a_joint_that_hardly_moves_asks_to_move_it():
    """Its experiment would show as little of it, and a finer encoder is not what lacks."""
    runs = with_torque(exact_runs(size=0.05), 1, lambda motion: 0.3 * motion.q[1])
    strict = replace(CRITERIA, min_votes=1.01)
    found = diagnose(load_robot(), runs, bands=BANDS, catalogue=(Spring(),), criteria=strict)
    (decision,) = (item for item in found.search.decisions if item.label == "spring of joint2")
    assert decision.examination.p_value * found.search.tried < strict.family_error
    for why, motion in (("chance", Spring.experiment), (f"{BY_NOISE} makes it", "move joint2 further and faster: ")):
        search = replace(found.search, decisions=(replace(decision, why=why),))
        (asked,) = (item for item in next_steps(replace(found, search=search)) if item.question.startswith("to judge"))
        assert asked.motion.startswith(motion)
