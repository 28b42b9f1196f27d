"""comparison.json and the sentences beside it."""

from __future__ import annotations

import pytest

from scara_ident.identification.compare import compare
from scara_ident.report.comparison import comparison_dict, comparison_sentences
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, complete, exact_runs, with_torque

ROBOT = load_robot()


@pytest.fixture(scope="module")
def clean():
    return compare(ROBOT, exact_runs(3), bands=BANDS)


def test_without_bias_none_is_told(clean):
    assert comparison_sentences(clean)[1] == "No error exceeds twice what noise in the parameters explains."


def test_the_weights_are_said(clean):
    assert clean.method == "wls"
    assert comparison_sentences(clean)[2] == "Estimated by wls: each joint is weighted by its residual."
    plain = comparison_sentences(compare(ROBOT, exact_runs(3), method="ols", bands=BANDS))[2]
    assert plain == "Estimated by ols: every row of every joint counts the same."


def test_bias_in_one_trajectory_is_told_from_noise():
    runs = exact_runs(3)
    spoilt = with_torque(runs[:2], 1, lambda motion: 0.1 * motion.q[1])
    result = compare(ROBOT, [*spoilt, *runs[2:]], bands=BANDS)
    sentence = comparison_sentences(result)[1]
    assert sentence.startswith("Bias, not noise, is at work where")
    assert "A" in sentence.partition(" on ")[0]
    assert "joint2" in sentence


def test_the_report_says_the_same_by_name(clean):
    content = comparison_dict(clean)
    assert content["errors"]["B"]["A"]["joint2"] == clean.errors[1, 0, 1]
    assert content["normalised"]["B"]["B"] == {"joint1": 1.0, "joint2": 1.0}
    assert content["average_of_predicted"]["A"]["joint1"] == pytest.approx(clean.errors[0, :, 0].mean())
    assert content["average_of_estimated"]["A"]["joint1"] == pytest.approx(clean.errors[:, 0, 0].mean())
    assert set(content["parameters"]["C"]) == set(complete().names)
    curve = content["friction"]["joint1"]["torque"]["A"]
    value = clean.trajectories[0].estimate.value[complete().names.index("a01")]
    assert curve[0] == pytest.approx(value)
