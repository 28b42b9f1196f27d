"""Every trajectory's parameters against every trajectory."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.errors import RecordingError
from scara_ident.estimation.observations import observe
from scara_ident.identification.compare import _spread, compare
from scara_ident.motion.prepared import prepare
from scara_ident.robot.robot import load_robot
from tests.diagnosis.made import BANDS, NOISE, complete, exact_runs

ROBOT = load_robot()


@pytest.fixture(scope="module")
def clean():
    return compare(ROBOT, exact_runs(3), bands=BANDS)


def test_errors_are_those_of_the_rows_predicted_by_hand(clean):
    runs = exact_runs(3)
    model = complete()
    for i, name in enumerate("ABC"):
        rows = observe(model, prepare([run for run in runs if run.trajectory == name], BANDS)).by_joint
        for k, summary in enumerate(clean.trajectories):
            for j in range(2):
                assert clean.errors[i, k, j] == pytest.approx(rows[j].rms(summary.estimate.value), rel=1e-9)


def test_a_trajectorys_own_parameters_predict_it_best(clean):
    # Least squares minimises the sum over joints.
    total = np.sum(clean.errors**2, axis=2)
    for i in range(3):
        assert total[i, i] == pytest.approx(total[i].min(), rel=1e-9)


def test_without_bias_the_covariance_predicts_the_errors(clean):
    ratio = clean.errors / clean.expected
    assert np.all(ratio > 0.5)
    assert np.all(ratio < 1.5)
    for i in range(3):
        assert np.all(clean.expected[i, i] >= clean.errors[i, i])


def test_repeatability_is_the_noise_and_names_are_kept(clean):
    assert [summary.name for summary in clean.trajectories] == ["A", "B", "C"]
    assert clean.trajectories[1].recordings == ("B_1", "B_2")
    for summary in clean.trajectories:
        assert summary.sigma == pytest.approx(NOISE, rel=0.15)
        assert np.all(summary.peak_velocity <= 2.6)
        assert np.all(summary.peak_velocity > 0.5)
        assert np.isfinite(summary.log_det)
        assert summary.condition > 1.0


def test_sensors_zeroed_before_each_run_are_no_bias(clean):
    """`Bias, not noise, is at work`: 6 times what the covariance promises, on runs that differed in their zeros alone."""
    rng = np.random.default_rng(7)
    runs = [
        replace(run, effort=run.effort + 20.0 * np.array(NOISE)[:, None] * rng.standard_normal((2, 1)))
        for run in exact_runs(3)
    ]
    found = compare(ROBOT, runs, bands=BANDS)
    assert "each recording's own offset" in " ".join(found.notes)
    assert not any("own offset" in note for note in clean.notes)
    np.testing.assert_allclose(found.errors, clean.errors, rtol=0.1)
    assert np.all(found.errors / found.expected < 1.5)


def test_one_trajectory_is_not_a_comparison():
    with pytest.raises(RecordingError, match="at least two trajectories"):
        compare(ROBOT, exact_runs()[:2], bands=BANDS)


def test_a_parameter_left_open_counts_on_the_joints_that_depend_on_it(clean):
    """No row of joint1 depends on the offset of joint2."""
    rows = observe(complete(), prepare(exact_runs(3), BANDS)).by_joint
    covariance = clean.trajectories[0].estimate.covariance.copy()
    place = complete().names.index("p_o2")
    before = [_spread(information, covariance) for information in rows]
    covariance[place, place] = np.inf
    assert _spread(rows[0], covariance) == before[0]
    assert _spread(rows[1], covariance) == np.inf
