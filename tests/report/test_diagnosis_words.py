"""A diagnosis in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis import diagnose
from scara_ident.diagnosis.candidates.candidates import Candidate
from scara_ident.diagnosis.evidence.outcome import Unexplained
from scara_ident.diagnosis.fitting.effect_parameters import RotorInertia
from scara_ident.diagnosis.held_out.gain import HeldOutGain
from scara_ident.diagnosis.selection.confounding import Confounder
from scara_ident.diagnosis.selection.tentative import TentativeEffect
from scara_ident.effects import Parameter
from scara_ident.effects.parameters import Member
from scara_ident.effects.payload import FreePayloadChange, PayloadOfRecordings
from scara_ident.effects.periodic import TorqueRipple
from scara_ident.effects.position import Spring
from scara_ident.estimation.run_offsets import rms_of
from scara_ident.inquiry.next_steps import next_steps
from scara_ident.report.diagnosis import diagnosis_dict
from scara_ident.report.diagnosis_words import quantity, sentences
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, exact_runs, with_torque


def test_words_name_effect_value_and_error(result):
    said = " ".join(sentences(result))
    for text in (
        "Found spring on joint2",
        "stiffness 0.0",
        "N m/rad",
        "Rms error on the held-out recordings",
        "joint2",
    ):
        assert text in said
    assert "Unexplained" not in said


def test_where_the_effects_make_it_worse_it_is_said(result):
    """On a measured arm of six joints the error of joint2 on other motions rose from 0.169 to 0.428 N m, in the middle of a line."""
    assert "Worse with" not in " ".join(sentences(result))
    off = result.after.value.copy()
    off[-1] *= -4.0
    found = replace(result, after=replace(result.after, value=off))
    (said,) = (
        words for words in sentences(found) if words.startswith("Worse with the effects than without them: joint2 (")
    )
    times = float(said.partition("(")[2].partition(" times")[0])
    before, after = (
        rms_of(each.value, held)[1]
        for each, held in ((found.before, found.validation_before), (found.after, found.validation_after))
    )
    assert times == pytest.approx(after / before, rel=0.05)
    assert times > 1.2


@pytest.mark.parametrize(
    ("std", "symmetric_power", "said"),
    [
        (150.0, -1.0, "stiffness 3.84e+03 ± 2e+02 N m/rad"),
        (1504.0, 1.0, "stiffness 3.84e+03 ± 2e+03 N m/rad"),
        (1504.0, -1.0, "stiffness 3845 N m/rad (2160 to 17700, 95 %)"),
        (2000.0, -1.0, "stiffness 3845 N m/rad (above 1880, 95 %)"),
        (9000.0, 0.5, "stiffness 3845 N m/rad (below 42900, 95 %)"),
        (38450.0, 0.0, "stiffness about 3.84e+03 N m/rad (not determined by recordings)"),
        (np.inf, -1.0, "stiffness about 3.84e+03 N m/rad (not determined by recordings)"),
    ],
)
def test_an_interval_is_said_where_a_standard_deviation_says_too_little(std: float, symmetric_power: float, said: str):
    assert quantity("stiffness", Parameter(3845.0, std, "N m/rad", symmetric_power)) == said


def test_what_says_the_law_has_no_uncertainty():
    assert quantity("exponent", Parameter(1.0, 0.0, "1")) == "exponent 1"


def test_where_it_cannot_be_determined_the_first_sentence_says_so_then_what_to_do_and_why(result):
    unsure = replace(result.evidence[0], shown=False, by="", why="it is not white")
    undecided = replace(result, verdict="undecided", evidence=(unsure, result.evidence[1]), effects=())
    first, second, third, *_ = sentences(undecided)
    assert first == "Undecided: these recordings cannot show whether something is missing."
    assert second == f"To do first: {next_steps(undecided)[0].within()}"
    assert third == "On joint1: it is not white."
    both = (
        replace(unsure, why="76% of it is not white"),
        replace(unsure, joint="joint2", why="26% of it is not white"),
    )
    assert sentences(replace(undecided, evidence=both))[2] == "On joint1, joint2: 26% to 76% of it is not white."
    assert sentences(replace(undecided, evidence=both[:1]))[2] == "On joint1: 76% of it is not white."
    lacking = replace(undecided, evidence=(replace(unsure, lacks=True), result.evidence[1]))
    assert (
        sentences(lacking)[0]
        == "Undecided: something is missing on joint1, but these recordings cannot show what it is."
    )
    assert diagnosis_dict(lacking)["evidence"]["joint1"]["lacks"] is True
    found, *_ = sentences(replace(undecided, effects=result.effects))
    assert found == "Undecided: these recordings cannot show whether something else is missing too."


def test_a_model_to_try_is_reported_where_a_straight_friction_law_leaves_a_curve():
    runs = with_torque(exact_runs(), 0, lambda motion: 0.05 * motion.v[0] ** 3)
    found = diagnose(load_robot(), runs, model="basic", bands=BANDS, catalogue=())
    words = " ".join(sentences(found))
    assert found.unexplained is not None
    assert found.unexplained.signals == (f"velocity of {found.unexplained.joint}",)
    assert "linear in speed: try model='complete'" in words
    cubic = " ".join(sentences(diagnose(load_robot(), runs, bands=BANDS, catalogue=())))
    assert "try model" not in cubic


def test_the_rotor_that_a_result_rests_on_is_reported_where_nobody_stated_it(result):
    told = RotorInertia("joint1", 4.1, 1.02, False, 2.4, True)
    roughly = RotorInertia("joint1", 4.1, 1.5, False, 2.4, True)
    guessed = RotorInertia("joint2", 2.0, 2.9, False, 2.4, False)
    stated = RotorInertia("joint2", 4.0, 1.2, True, 4.0, False)
    by_model = RotorInertia("joint2", 4.0, None, False, 2.4, True)
    words = sentences(replace(result, rotors=(told, roughly, guessed, stated, by_model)))
    assert [item for item in words if "rotor" in item] == [
        "The rotor inertia of joint1 is not stated: it was guessed as 2.4 kg m^2 at the joint from the size of the "
        "motor and identified as 4.1 ± 0.08 kg m^2.",
        "The rotor inertia of joint1 is not stated: it was guessed as 2.4 kg m^2 at the joint from the size of the "
        "motor and identified as 4.1 kg m^2 within a factor of 1.5.",
        "The rotor inertia of joint2 is not stated and the data hardly determine it: it was guessed as 2.4 kg m^2 at "
        "the joint from the size of the motor, which may be wrong by a factor of 3; parameters that depend on it have "
        "a large ±. State rotor_inertia.",
    ]
    (entry,) = diagnosis_dict(replace(result, rotors=(told,)))["rotors"]
    assert entry == {
        "joint": "joint1", "armature": 4.1, "factor": 1.02, "unit": "kg m^2", "nominal": 2.4, "stated": False, "determined": True,
    }  # fmt: skip
    assert diagnosis_dict(result)["rotors"] == []


def test_an_effect_that_is_there_and_whose_size_is_not_determined_says_so(result):
    (effect,) = result.effects
    assert diagnosis_dict(result)["effects"][0]["size_determined"] is True
    unsure = replace(result, effects=(replace(effect, size_determined=False),))
    said = f"it is significant (p = {effect.p_value:.1e}), but its size is not determined"
    assert said in " ".join(sentences(unsure))
    assert "its size is not determined" not in " ".join(sentences(result))
    # What those held out speak against is not said to be there.
    against = HeldOutGain(-0.3, 0.1, 0.05, "joint2", 0.02, 0.03)
    doubted = " ".join(sentences(replace(result, effects=(replace(effect, size_determined=False, held_out=against),))))
    assert "In doubt: spring on joint2" in doubted
    assert "its size is not determined" not in doubted
    assert diagnosis_dict(unsure)["effects"][0]["size_determined"] is False


def test_the_verdict_comes_first_then_what_was_found_then_why_not_more_and_what_is_worth_a_look_after_the_errors(
    result,
):
    """The line of a report that stands out was that of an effect worth a look, above what is unexplained."""
    guess = TentativeEffect("time_delay", None, "a delay", "may be chance", "two speeds", 0.01, 0.2, None)
    starts = {
        "undecided": ["Undecided", "Found spring", "To do first", "On joint1", "Rms error", "Worth a look"],
        "unexplained": ["Unexplained", "Found spring", "Rms error", "Worth a look"],
    }
    doubted = tuple(replace(item, shown=False, why="record more") for item in result.evidence)
    remainder = Unexplained("joint1", ("position of joint1",), 0.1, 0.5)
    for verdict, wanted in starts.items():
        left = remainder if verdict == "unexplained" else None
        said = sentences(replace(result, verdict=verdict, unexplained=left, tentative=(guess,), evidence=doubted))
        places = [next(k for k, words in enumerate(said) if words.startswith(start)) for start in wanted]
        assert places == sorted(places), said
        assert places[0] == 0


def test_where_what_is_left_depends_on_no_signal_it_is_said_what_to_do_first(result):
    left = replace(result, verdict="unexplained", unexplained=Unexplained("joint1", (), 0.1, 0.0))
    said = sentences(left)
    place = next(k for k, words in enumerate(said) if words.endswith("no effect of the catalogue explains it."))
    assert said[place + 1] == f"To do first: {next_steps(left)[0].within()}"
    shown = replace(left, unexplained=Unexplained("joint1", ("position of joint1",), 0.1, 0.5))
    assert not any(words.startswith("To do first") for words in sentences(shown))


def test_beside_a_joint_that_stays_unexplained_others_that_lack_something_are_named(result):
    """On the shoulder something was left, and of the slide, whose rotor was -0.47 ± 0.01 kg m^2, nothing was said."""
    evidence = tuple(replace(item, shown=False, why=f"reason of {item.joint}", lacks=True) for item in result.evidence)
    left = replace(result, verdict="unexplained", unexplained=Unexplained("joint1", (), 0.1, 0.0), evidence=evidence)
    said = sentences(left)
    assert "On joint2: reason of joint2." in said
    assert not any("reason of joint1" in text for text in said)
    unsure = tuple(replace(item, lacks=False) for item in evidence)
    assert not any("reason of" in text for text in sentences(replace(left, evidence=unsure)))


def test_what_is_unexplained_is_said_to_go_as_an_effect_that_no_arm_has():
    """A force that pushed away from rest, told to 1e-80, stood in the table of candidates alone."""
    runs = with_torque(exact_runs(), 0, lambda motion: -0.3 * motion.q[0])
    found = diagnose(load_robot(), runs, bands=BANDS, catalogue=(Spring(),))
    said = next(item for item in sentences(found) if item.startswith("Unexplained"))
    assert "it looks like spring of joint1" in said
    assert "it would push away from its rest position" in said


def test_a_confounder_of_its_own_name_is_distinguished_from_it(result):
    """A payload of one recording could not be told, it said, from payload_change."""
    carried, taken_up, spring, ripple = PayloadOfRecordings(), FreePayloadChange(), Spring(), TorqueRipple()
    rivals = tuple(
        Confounder(label, family.name, joint, 0.8, Candidate(family, member), (1.0,))
        for label, family, joint, member in (
            ("payload_change", taken_up, None, Member(None, (3.0,))),
            ("spring of joint2", spring, "joint2", Member(1)),
            ("torque_ripple of joint2", ripple, "joint2", Member(1, (0.02,))),
        )
    )
    found = replace(
        result.effects[0], effect=carried.name, joint=None, description="a payload in a", confounded_with=rivals
    )
    assert found.confounder_names(result.search.scene) == (
        "payload_change (a payload at an unknown place, picked up or put down during a run)",
        "spring of joint2",
        # Of which only its period says whether it is the motor's.
        f"torque_ripple of joint2 ({ripple.description(result.search.scene, Member(1, (0.02,)))})",
    )
    said = " ".join(sentences(replace(result, effects=(found,))))
    assert "cannot distinguish it from: payload_change (a payload at an unknown place" in said
