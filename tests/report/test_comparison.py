"""comparison.json and the sentences beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.identification.compare import compare
from scara_ident.report.comparison import comparison_dict, comparison_sentences
from scara_ident.report.summaries.comparison import tables
from scara_ident.report.summaries.words import text_of
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, complete, exact_runs, with_torque

ROBOT = load_robot()


@pytest.fixture(scope="module")
def clean():
    return compare(ROBOT, exact_runs(3), bands=BANDS)


def test_without_bias_none_is_reported(clean):
    assert comparison_sentences(clean)[1] == "No error exceeds twice the error that noise in the parameters explains."


def test_the_weights_are_said(clean):
    assert clean.method == "wls"
    assert comparison_sentences(clean)[2] == "Estimated by wls: each joint is weighted by its residual."
    plain = comparison_sentences(compare(ROBOT, exact_runs(3), method="ols", bands=BANDS))[2]
    assert plain == "Estimated by ols: every row of every joint counts the same."


def test_bias_in_one_trajectory_is_distinguished_from_noise():
    runs = exact_runs(3)
    spoilt = with_torque(runs[:2], 1, lambda motion: 0.1 * motion.q[1])
    result = compare(ROBOT, [*spoilt, *runs[2:]], bands=BANDS)
    sentence = comparison_sentences(result)[1]
    assert sentence.startswith("The error of the parameters from ")
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


def test_a_fit_that_leaves_a_parameter_open_is_neither_best_nor_explained(clean):
    """Whatever its errors are: what noise explains of them is not known."""
    open_, expected = clean.trajectories[2], clean.expected.copy()
    covariance = open_.estimate.covariance.copy()
    place = complete().names.index("p_o2")
    covariance[place, place], expected[:, 2, 1] = np.inf, np.inf
    left = replace(open_, estimate=replace(open_.estimate, covariance=covariance))
    best = replace(clean, errors=clean.errors * [[[1.0], [1.0], [0.5]]], expected=expected)
    held = replace(best, trajectories=(*clean.trajectories[:2], left))
    found = comparison_sentences(held)
    assert "C" not in found[0]
    assert found[1] == "No other error exceeds twice the error that noise in the parameters explains."
    assert found[2].startswith("Parameters from C are not ranked: no standard deviation is known for p_o2")
    assert "(-)" in text_of(*tables(comparison_dict(held)))
    assert "inf" not in text_of(*tables(comparison_dict(held)))


def test_of_fits_that_all_leave_a_parameter_open_none_is_best(clean):
    found = comparison_sentences(replace(clean, expected=np.full_like(clean.expected, np.inf)))
    assert not any("best" in sentence or "exceeds" in sentence for sentence in found)
    assert sum("not ranked" in sentence for sentence in found) == 3


def test_a_joint_that_rests_in_a_trajectory_has_no_error_there_and_is_averaged_over_the_others(clean):
    errors = clean.errors.copy()
    errors[1, :, 1] = np.nan
    content = comparison_dict(replace(clean, errors=errors))
    assert content["average_of_estimated"]["A"]["joint2"] == pytest.approx(errors[[0, 2], 0, 1].mean())
    assert np.isnan(content["average_of_predicted"]["B"]["joint2"])
    assert "nan" not in text_of(*tables(content))
    # Of one that rests in all of them nothing is known.
    errors[:, :, 1] = np.nan
    assert np.isnan(comparison_dict(replace(clean, errors=errors))["average_of_estimated"]["A"]["joint2"])
