"""diagnosis.json as the contract has it, and the story in words."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis import diagnose
from scara_ident.diagnosis.effect_parameters import RotorInertia
from scara_ident.effects.friction import Stribeck
from scara_ident.effects.position import Spring
from scara_ident.files import plain
from scara_ident.model.model import build_model
from scara_ident.model.urdf_values import urdf_values
from scara_ident.report.diagnosis import best_by_label, diagnosis_dict, sentences
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, exact_runs, with_torque

CATALOGUE = (Spring(), Stribeck())
JOINTS = {"joint1", "joint2"}


def spring(motion):
    return 0.05 * motion.q[1]


@pytest.fixture(scope="module")
def result():
    runs = exact_runs(3)
    held_out = with_torque(runs[4:5], 1, spring)
    return diagnose(
        load_robot(), with_torque(runs[:4], 1, spring), validation=held_out, bands=BANDS, catalogue=CATALOGUE
    )


@pytest.fixture(scope="module")
def content(result):
    return json.loads(json.dumps(plain(diagnosis_dict(result)), allow_nan=False))


def test_it_has_the_keys_of_the_contract(content):
    assert {
        "verdict", "noise_floor", "effects", "training", "validation", "not_identifiable", "candidates", "unexplained",
    } <= set(content)  # fmt: skip
    (effect,) = content["effects"]
    assert {"effect", "joint", "parameters", "confounded_with", "p_value", "training"} <= set(effect)
    assert (content["verdict"], effect["effect"], effect["joint"]) == ("explained", "spring", "joint2")
    assert set(effect["parameters"]["stiffness"]) == {"value", "std", "unit"}
    for row in content["candidates"]:
        assert row["decision"] in ("accepted", "rejected")
        assert row["why"]
        assert {"effect", "joint", "p_value"} <= set(row)
    for row in content["not_identifiable"]:
        assert row["absorbed_by"]
    assert content["unexplained"] is None


def test_before_and_after_are_by_joint_and_fall(content):
    for kind in ("training", "validation"):
        part = content[kind]
        for key in ("before", "after", "before_unfiltered", "after_unfiltered", "before_relative", "after_relative"):
            assert set(part[key]) == JOINTS
        assert part["after"]["joint2"] < 0.3 * part["before"]["joint2"]
        assert part["after_unfiltered"]["joint2"] > part["after"]["joint2"]
    assert set(content["recordings"]["validation"]) == {"C_1"}
    assert set(content["recordings"]["training"]) == {"A_1", "A_2", "B_1", "B_2"}


def test_what_is_left_is_near_the_noise_floor(content):
    for joint in JOINTS:
        assert content["training"]["after"][joint] == pytest.approx(content["noise_floor"][joint], rel=0.15)


def test_the_error_of_one_recording_is_the_root_of_its_share(content, result):
    errors = [content["recordings"]["training"][name]["after"]["joint1"] for name in ("A_1", "A_2", "B_1", "B_2")]
    counts = [item.by_joint[0].rows for item in result.training_after.each]
    pooled = np.sqrt(np.average(np.square(errors), weights=counts))
    assert content["training"]["after"]["joint1"] == pytest.approx(pooled, rel=1e-6)


def test_candidates_are_one_per_label_the_best_first(content, result):
    labels = [row["label"] for row in content["candidates"]]
    assert len(labels) == len(set(labels))
    gains = [row["gain"] for row in content["candidates"]]
    assert gains == sorted(gains, reverse=True)
    for decision in best_by_label(result.search.decisions):
        assert all(decision.gain >= item.gain for item in result.search.decisions if item.label == decision.label)


def test_p_values_are_probabilities(content):
    for row in (*content["candidates"], *content["effects"]):
        assert 0.0 <= row["p_value"] <= 1.0


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


def test_where_it_cannot_be_told_the_first_sentence_says_so(result):
    unsure = replace(result.evidence[0], shown=False, by="", why="it is not white")
    undecided = replace(result, verdict="undecided", evidence=(unsure, result.evidence[1]), effects=())
    first, second, *_ = sentences(undecided)
    assert first == "Undecided: these recordings cannot tell whether something is missing."
    assert second == "On joint1: it is not white."
    both = (
        replace(unsure, why="76% of it is not white"),
        replace(unsure, joint="joint2", why="26% of it is not white"),
    )
    assert sentences(replace(undecided, evidence=both))[1] == "On joint1, joint2: 26% to 76% of it is not white."
    assert sentences(replace(undecided, evidence=both[:1]))[1] == "On joint1: 76% of it is not white."
    found, *_ = sentences(replace(undecided, effects=result.effects))
    assert found == "Undecided: these recordings cannot tell whether something more is missing than was found."


def test_without_repetitions_the_noise_floor_is_unknown_and_said_so():
    result = diagnose(load_robot(), exact_runs()[::2], bands=BANDS, catalogue=())
    content = diagnosis_dict(result)
    assert content["noise_floor"] == {"joint1": None, "joint2": None}
    assert content["validation"] == {"before": {}, "after": {}}
    assert any("No trajectory was repeated" in sentence for sentence in content["summary"])
    assert content["summary"][0].startswith("The model lacks nothing")


def test_a_remainder_is_told_with_joint_signal_and_size():
    runs = with_torque(exact_runs(), 1, lambda motion: 0.03 * np.sin(5.0 * motion.q[1]))
    content = diagnosis_dict(diagnose(load_robot(), runs, bands=BANDS, catalogue=()))
    assert content["verdict"] == "unexplained"
    assert set(content["unexplained"]) == {"joint", "signals", "rms", "explained_share"}
    assert "depends on position of joint2" in content["summary"][-2]
    assert content["summary"][-1].startswith("No recording tells a scale common to all torques and masses")
    assert set(content["urdf_scale"]) <= {"joint1", "joint2"}
    stated = {row["name"]: row["urdf"] for row in content["parameters"]}
    assert stated["P_d1"] == pytest.approx(urdf_values(build_model(load_robot()))[0])


def test_a_straight_friction_law_that_leaves_a_curve_is_told_what_to_try():
    runs = with_torque(exact_runs(), 0, lambda motion: 0.05 * motion.v[0] ** 3)
    found = diagnose(load_robot(), runs, model="basic", bands=BANDS, catalogue=())
    words = " ".join(sentences(found))
    assert found.unexplained is not None
    assert found.unexplained.signals == (f"velocity of {found.unexplained.joint}",)
    assert "straight in speed: try --model complete" in words
    cubic = " ".join(sentences(diagnose(load_robot(), runs, bands=BANDS, catalogue=())))
    assert "try --model" not in cubic


def test_the_rotor_that_a_result_rests_on_is_told_where_nobody_stated_it(result):
    told = RotorInertia("joint1", 4.1, 1.02, False, 2.4, True)
    roughly = RotorInertia("joint1", 4.1, 1.5, False, 2.4, True)
    guessed = RotorInertia("joint2", 2.0, 2.9, False, 2.4, False)
    stated = RotorInertia("joint2", 4.0, 1.2, True, 4.0, False)
    by_model = RotorInertia("joint2", 4.0, None, False, 2.4, True)
    words = sentences(replace(result, rotors=(told, roughly, guessed, stated, by_model)))
    assert [item for item in words if "rotor" in item] == [
        "The rotor inertia of joint1 is not stated: guessed at 2.4 kg m^2 at the joint from the size of its motor, and "
        "found to be 4.1 ± 0.08 kg m^2.",
        "The rotor inertia of joint1 is not stated: guessed at 2.4 kg m^2 at the joint from the size of its motor, and "
        "found to be 4.1 kg m^2 within a factor of 1.5.",
        "The rotor inertia of joint2 is not stated and hardly shows: guessed at 2.4 kg m^2 at the joint from the size of "
        "its motor, which may err by a factor of 3; what depends on it is as unsure as its ± says. State rotor_inertia.",
    ]
    (entry,) = diagnosis_dict(replace(result, rotors=(told,)))["rotors"]
    assert entry == {
        "joint": "joint1", "armature": 4.1, "factor": 1.02, "unit": "kg m^2", "nominal": 2.4, "stated": False, "told": True,
    }  # fmt: skip
    assert diagnosis_dict(result)["rotors"] == []


def test_an_effect_that_is_there_and_whose_size_is_not_told_says_so(result, content):
    (effect,) = result.effects
    assert content["effects"][0]["size_told"] is True
    unsure = replace(result, effects=(replace(effect, size_told=False),))
    assert "but not how large it is" in " ".join(sentences(unsure))
    assert "but not how large it is" not in " ".join(sentences(result))
    assert diagnosis_dict(unsure)["effects"][0]["size_told"] is False
