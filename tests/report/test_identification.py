"""identification.json as the contract has it, and the sentences beside it."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from scara_ident.estimation import ConsistentOptions
from scara_ident.estimation.pushing import pushes
from scara_ident.estimation.run_variation import JointVariation, RunVariation
from scara_ident.files import plain
from scara_ident.report.identification import below_zero_said, identification_dict, sentences
from tests.report.simulated import made, run


@pytest.fixture(scope="module")
def result():
    return made([run("OJD_1", 1), run("OJD_2", 2)], [run("CI_1", 3, start=4.0)], method="wls")


@pytest.fixture(scope="module")
def content(result):
    return json.loads(json.dumps(plain(identification_dict(result)), allow_nan=False))


def test_it_has_the_keys_of_the_contract(content):
    assert (content["robot"], content["model"], content["method"], content["samples"]) == (
        "scara03",
        "complete",
        "wls",
        6000,
    )
    assert {"name", "joint", "value", "std", "unit", "meaning"} <= set(content["parameters"][0])
    assert {"log_det", "condition", "errors"} <= set(content)
    assert set(content["errors"]) == {"training", "validation"}
    assert set(content["errors"]["training"]) == {"OJD_1", "OJD_2"}
    assert set(content["errors"]["validation"]) == {"CI_1"}
    joints = content["errors"]["training"]["OJD_1"]
    assert set(joints) == {"joint1", "joint2"}
    assert {"rms", "relative", "rms_unfiltered"} <= set(joints["joint1"])
    assert content["band_hz"] == {"joint1": 15.0, "joint2": None}


def test_parameters_carry_the_papers_names(content):
    names = [row["name"] for row in content["parameters"]]
    assert names == [*(f"P_d{k}" for k in range(1, 6)), *(f"a{p}{j}" for j in (1, 2) for p in range(4)), "p_o1", "p_o2"]
    first = content["parameters"][0]
    assert (first["joint"], first["unit"], first["meaning"]) == ("joint1", "kg m^2", "I1z + m2 l1^2 + Jm1/tau1^2")


def test_numbers_are_those_of_the_estimate(result, content):
    np.testing.assert_array_equal([row["value"] for row in content["parameters"]], result.estimate.value)
    np.testing.assert_array_equal([row["std"] for row in content["parameters"]], result.estimate.std)
    (error,) = [result.validation_errors()["CI_1"][1]]
    assert content["errors"]["validation"]["CI_1"]["joint2"]["relative"] == error.relative
    assert (content["log_det"], content["condition"]) == (result.log_det, result.condition)


def test_the_noise_floor_stands_beside_the_errors(content):
    assert content["repeatability"]["OJD"]["joint1"] == pytest.approx(0.02, rel=0.05)
    assert content["errors"]["training"]["OJD_1"]["joint1"]["rms_unfiltered"] == pytest.approx(0.02, rel=0.1)


def test_what_was_left_out_is_said(content):
    left_out = content["left_out"]
    assert left_out["training"]["OJD_1"]["ends_s"] > 0.0
    assert set(left_out["training"]["OJD_1"]["at_rest_share"]) == {"joint1", "joint2"}
    assert set(left_out["validation"]) == {"CI_1"}


def test_a_fitted_and_a_held_out_run_of_one_name_do_not_hide_each_other():
    """Two folders may both hold an OJD_1."""
    one = identification_dict(made([run("OJD_1", 1)], [run("OJD_1", 3, seconds=8.0, start=4.0)]))
    assert one["errors"]["training"]["OJD_1"] != one["errors"]["validation"]["OJD_1"]
    assert set(one["left_out"]["training"]) == set(one["left_out"]["validation"]) == {"OJD_1"}


def test_the_worst_held_out_run_is_named_in_words(result):
    worst = max(
        (error.relative, joint)
        for joint, error in zip(("joint1", "joint2"), result.validation_errors()["CI_1"], strict=True)
    )
    first = sentences(result)[0]
    assert first.startswith(f"The largest held-out error is on CI_1, {worst[1]}: ")
    assert f"{worst[0]:.1%} of the torque" in first


def test_without_held_out_runs_that_is_said_instead():
    text = sentences(made([run("OJD_1", 1)]))
    assert text[0].startswith("There are no held-out recordings")
    assert not [said for said in text if "do not determine" in said]


def test_what_is_undetermined_is_named_and_null():
    result = made([run("OJD_1", 1, still=True)])
    content = plain(identification_dict(result))
    open_ = [row["name"] for row in content["parameters"] if row["undetermined"]]
    assert {"P_d5", "a02", "a12", "a22", "a32", "p_o2"} <= set(open_)
    assert all((row["std"] is None) == row["undetermined"] for row in content["parameters"])
    (said,) = [text for text in sentences(result) if "do not determine" in text]
    assert all(name in said for name in open_)
    assert content["errors"]["training"]["OJD_1"]["joint2"]["rms"] is None
    assert (content["log_det"], content["condition"]) == (None, None)
    json.dumps(content, allow_nan=False)


def test_what_is_not_distinguished_from_zero_is_named(result):
    small = of_zero(result)
    assert "P_d3" in small or "a31" in small or "p_o1" in small
    assert "P_d1" not in small


def of_zero(result):
    """Return the sentence on parameters that do not differ from zero."""
    (said,) = (text for text in sentences(result) if "differ from zero" in text)
    return said


def with_std(result, std):
    """Return a result whose parameters have these standard deviations."""
    return replace(result, estimate=replace(result.estimate, covariance=np.diag(std**2)))


def test_parameters_are_said_to_be_determined_only_where_each_differs_from_zero(result):
    """Where most were within two standard deviations of zero, every parameter was said to be determined."""
    names, size = list(result.model.names), np.abs(result.estimate.value)
    assert "Every parameter is determined." in sentences(with_std(result, size / 10.0))
    at_zero = ["P_d3", "a31"]
    few = with_std(result, size / np.where(np.isin(names, at_zero), 1.9, 10.0))
    assert of_zero(few) == ("13 of 15 parameters differ from zero by more than two standard deviations; not P_d3, a31.")
    assert "Every parameter is determined." not in sentences(few)
    assert of_zero(with_std(result, size)).startswith("0 of 15 parameters differ from zero")


def test_parameters_that_are_not_determined_are_not_counted():
    said = of_zero(made([run("OJD_1", 1, still=True)]))
    assert " determined parameters differ from zero" in said and " of 15 " not in said


def test_bodies_that_only_sums_tell_are_not_said_to_be_determined(result):
    """Of an arm of half a kilogram, by a URDF whose right angles have few digits, m2 was -1400 ± 3400 kg: every parameter was determined."""
    sure = with_std(result, np.abs(result.estimate.value) / 10.0)
    assert "Every parameter is determined." in sentences(sure)
    estimate, place = sure.estimate, list(result.model.names).index("P_d5")
    covariance = estimate.covariance.copy()
    covariance[place, place] = 1e6
    said = sentences(replace(result, estimate=replace(estimate, covariance=covariance)))
    assert "Every parameter is determined." not in said
    (own,) = (text for text in said if "only in sums with others" in text)
    assert own.startswith("P_d5 is not determined alone")


def test_where_no_standard_deviation_is_known_that_is_said(result):
    """Of a carriage pushed once a mass of 25.2 kg, with no standard deviation, was within two of zero."""
    assert not [text for text in sentences(result) if text.startswith("The standard deviation of ")]
    estimate = result.estimate
    place = list(result.model.names).index("P_d1")
    covariance = estimate.covariance.copy()
    covariance[place, place] = np.inf
    lost = replace(result, estimate=replace(estimate, covariance=covariance))
    (said,) = (text for text in sentences(lost) if text.startswith("The standard deviation of "))
    assert said.startswith(
        "The standard deviation of P_d1 is not known: almost all information about it comes from one stretch"
    )
    assert "P_d1" not in of_zero(lost) and " of 14 determined parameters" in of_zero(lost)


def test_the_weights_are_said(result, content):
    first, second = result.estimate.weights
    assert content["weights"] == {"joint1": first, "joint2": second}
    said = f"Each joint is weighted by its residual (wls): {1 / first:.3g} N m (joint1), {1 / second:.3g} N m (joint2)."
    assert said in content["summary"]
    plain_ = identification_dict(made([run("OJD_1", 1)], method="ols"))
    assert plain_["weights"] == {"joint1": 1.0, "joint2": 1.0}
    assert "Every row of every joint counts the same (ols)." in plain_["summary"]


def test_how_runs_differ_is_said(result):
    std = np.array([0.06, 0.0, 0.0, 0.0])
    item = JointVariation(np.ones((4, 6)), std, np.zeros((3, 4)), 0.01, np.array([0, 2, 4, 6]), np.zeros((3, 4)))
    estimate = replace(result.estimate, variation=RunVariation((item, None)))
    found = identification_dict(replace(result, estimate=estimate))
    assert found["run_variation"] == {"joint1": {"friction": 0.06}}
    assert "joint1 differs from run to run (standard deviation): its friction by 6 %." in found["summary"]
    alone = replace(result, estimate=replace(result.estimate, variation=None))
    assert identification_dict(alone)["run_variation"] == {}


def test_what_the_noise_of_positions_biases_is_said(result):
    bias = np.zeros(len(result.estimate.value))
    bias[0] = 0.5
    free = np.diag(result.estimate.covariance)[0]
    covariance = result.estimate.covariance + np.outer(bias, bias)
    assert free < bias[0] ** 2
    found = identification_dict(
        replace(result, estimate=replace(result.estimate, covariance=covariance, noise_bias=bias))
    )
    assert found["noise_bias"]["P_d1"] == 0.5
    assert (
        "The noise of the positions biases P_d1 by about 0.5; their standard deviations include that bias."
        in found["summary"]
    )
    alone = identification_dict(replace(result, estimate=replace(result.estimate, noise_bias=None)))
    assert alone["noise_bias"] == {}
    assert not any("noise of the positions" in said for said in alone["summary"])


def test_the_shape_of_friction_and_why_are_said():
    found = made([run("OJD_1", 1)], method="consistent")
    content = identification_dict(found)
    first, second = found.estimate.shapes
    assert content["friction_shape"]["joint1"] == {"shape": first.shape, "p_value": first.p_value, "why": first.why}
    assert content["summary"][-2] == (
        f"Friction is lubricated (dissipates energy, and grows less and less with speed) on joint1 (p = {first.p_value:.2g}), "
        f"joint2 (p = {second.p_value:.2g}): the data do not contradict it."
    )
    asked = made([run("OJD_1", 1)], method="consistent", options=ConsistentOptions(friction={"joint1": "free"}))
    said = [text for text in sentences(asked) if text.startswith("Friction is ")]
    assert said[0] == "Friction is free (no constraint) on joint1: as asked for."


def test_friction_that_pushes_is_named_where_no_parameter_of_its_own_is_below_zero(result):
    """Curved friction of 17 N m against the motion of a measured joint was passed over: "by no more than chance: Ia4"."""
    estimate, training = result.estimate, result.training
    value = np.abs(estimate.value)
    value[estimate.model.names.index("a12")] = -40.0
    changed = replace(estimate, value=value)
    _, push = pushes(changed, training)
    assert push is not None
    said = below_zero_said(changed, training)
    assert said is not None
    assert f"friction of joint2 at {push.speed:.2g} rad/s by {push.stds:.2g} standard deviations" in said
    assert "joint1" not in said
    assert said in sentences(replace(result, estimate=changed))


def test_of_few_recordings_it_is_said_that_their_standard_deviations_hold_no_run_variation(result):
    """On five measured arms parameters of one recording each, or of half of one, lay 1.2 to 1.7 times as far apart as their stds say (rms)."""
    third = made([run("OJD_1", 1), run("OJD_2", 2), run("OJD_3", 3)], method="wls")
    one = made([run("OJD_1", 1)], method="wls")
    few = [
        [said for said in sentences(each) if "is not in the standard deviations" in said]
        for each in (one, result, third)
    ]
    assert few == [
        [
            "How runs differ is not known from one recording and is not in the standard deviations: record three or more."
        ],
        [
            "How runs differ, except for offsets, is not known from two recordings and is not in the standard deviations: record three or more."
        ],
        [],
    ]


def test_notes_are_handed_on(result):
    assert identification_dict(replace(result, notes=("seen",)))["notes"] == ["seen"]


@pytest.mark.parametrize(
    ("stds", "said"),
    [(-1.5, "with so many parameters up to 4 may be chance"), (-6.0, "by more than chance"), (1.0, None)],
)
def test_what_cannot_be_negative_is_said_to_be_so_by_chance_or_not(result, stds: float, said: str | None):
    """Rotor inertias of a Panda of 6 standard deviations below zero were said to be of no real arm, and no more."""
    estimate = result.estimate
    value, std = np.abs(estimate.value), estimate.std
    coulomb = estimate.model.names.index("a01")
    value[coulomb] = stds * std[coulomb]
    found = below_zero_said(replace(estimate, value=value), result.training)
    if said is None:
        assert found is None
        return
    assert found is not None and said in found and f"a01 by {-stds:.2g} standard deviations" in found
    changed = replace(result, estimate=replace(estimate, value=value))
    assert found in sentences(changed)


def test_held_out_recordings_that_are_faster_are_said_to_be() -> None:
    slow, fast = run("OJD_1", 1), run("CI_1", 3, start=4.0)
    slower = replace(slow, time=2.0 * slow.time)
    for fitted, count in ((run("CI_2", 4, start=4.0), 0), (slower, 1)):
        said = [
            line for line in sentences(made([fitted], [fast])) if line.startswith("The held-out recordings are faster")
        ]
        assert len(said) == count
