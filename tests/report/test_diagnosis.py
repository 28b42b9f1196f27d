"""diagnosis.json as the contract has it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis import diagnose
from scara_ident.effects import Parameter
from scara_ident.files import plain
from scara_ident.model.model import build_model
from scara_ident.model.urdf_values import urdf_values
from scara_ident.report.diagnosis import best_by_label, diagnosis_dict
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, exact_runs, with_torque

JOINTS = {"joint1", "joint2"}


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


def test_without_repetitions_the_noise_floor_is_unknown_and_said_so():
    result = diagnose(load_robot(), exact_runs()[::2], bands=BANDS, catalogue=())
    content = diagnosis_dict(result)
    assert content["noise_floor"] == {"joint1": None, "joint2": None}
    assert content["validation"] == {"before": {}, "after": {}}
    assert any("No trajectory was repeated" in sentence for sentence in content["summary"])
    assert content["summary"][0].startswith("The model lacks nothing")


def test_a_remainder_is_reported_with_joint_signal_and_size():
    runs = with_torque(exact_runs(), 1, lambda motion: 0.03 * np.sin(5.0 * motion.q[1]))
    content = diagnosis_dict(diagnose(load_robot(), runs, bands=BANDS, catalogue=()))
    assert content["verdict"] == "unexplained"
    assert set(content["unexplained"]) == {"joint", "signals", "rms", "explained_share"}
    assert "depends on position of joint2" in content["summary"][-2]
    assert content["summary"][-1].startswith("Recordings cannot determine a common scale of all torques and masses")
    assert set(content["urdf_scale"]) <= {"joint1", "joint2"}
    stated = {row["name"]: row["urdf"] for row in content["parameters"]}
    assert stated["P_d1"] == pytest.approx(urdf_values(build_model(load_robot()))[0])


def test_a_skewed_parameter_has_its_interval_an_open_end_null(result):
    (effect,) = result.effects
    skewed = {"stiffness": Parameter(3845.0, 2000.0, "N m/rad", symmetric_power=-1.0)}
    found = replace(result, effects=(replace(effect, parameters=skewed),))
    entry = json.loads(json.dumps(plain(diagnosis_dict(found)), allow_nan=False))["effects"][0]["parameters"][
        "stiffness"
    ]
    assert set(entry) == {"value", "std", "unit", "interval"}
    assert entry["interval"] == [pytest.approx(1884.8, rel=1e-3), None]
