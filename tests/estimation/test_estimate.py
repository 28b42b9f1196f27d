"""What an estimate says of itself: its errors on recordings, its predictions, the paper's criteria."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from scara_ident.estimation import ols
from scara_ident.estimation.estimate import joint_errors, paper_criteria
from scara_ident.model.model import TorqueModel
from tests.arms import motion, sines
from tests.estimation.made import linear, rows, together, two_joint_model

NOISE = np.array([0.5, 0.01])


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> TorqueModel:
    return two_joint_model(tmp_path_factory.mktemp("arm"))


def test_errors_are_rms_of_the_residual_and_its_share_of_the_torque(model: TorqueModel):
    rng = np.random.default_rng(0)
    w = rows(rng, model, 4000)
    u = w @ np.arange(1.0, w.shape[2] + 1) + NOISE[:, None] * rng.standard_normal((2, 4000))
    whole = linear(model, "a_1", w, u, 100)
    halves = together([linear(model, f"a_{k}", w[:, k::2], u[:, k::2], 100) for k in (0, 1)])
    found = ols(whole)
    for item in (whole, halves):
        for j, error in enumerate(found.errors(item)):
            residual = u[j] - w[j] @ found.value
            assert error is not None
            assert error.rms == pytest.approx(np.sqrt(np.mean(residual**2)), rel=1e-10)
            assert error.relative == pytest.approx(np.sqrt(np.mean(residual**2) / np.mean(u[j] ** 2)), rel=1e-10)
            assert error.rms_unfiltered == pytest.approx(error.rms, rel=1e-10)
            assert error.relative_unfiltered == pytest.approx(error.relative, rel=1e-10)


def test_a_joint_without_rows_has_no_error_and_one_without_torque_no_share(model: TorqueModel):
    w = rows(np.random.default_rng(1), model, 400)
    item = linear(model, "a_1", w, np.zeros((2, 400)), 100)
    (part,) = item.data.stretches
    part.used[1] = False
    value = np.ones(w.shape[2])
    first, second = joint_errors(value, item)
    assert second is None
    assert first is not None
    assert first.rms == pytest.approx(np.sqrt(np.mean((w[0] @ value) ** 2)), rel=1e-10)
    assert first.rms_unfiltered == pytest.approx(first.rms, rel=1e-10)
    assert (first.relative, first.relative_unfiltered) == (None, None)


def test_a_prediction_is_the_models_torque_along_a_motion(model: TorqueModel):
    w = rows(np.random.default_rng(2), model, 400)
    found = ols(linear(model, "a_1", w, w.sum(axis=2), 100))
    moved = motion(*sines(np.random.default_rng(3), np.arange(200) / 1000.0, 2))
    assert_allclose(
        found.predict(moved.q.T, moved.v.T, moved.a.T).T, model.regressor(moved).sum(axis=1), rtol=1e-7, atol=1e-9
    )


def test_the_papers_criteria_count_2500_samples_whatever_the_length(model: TorqueModel):
    w = rows(np.random.default_rng(0), model, 2500)
    u = np.zeros(w.shape[:2])
    once = linear(model, "a_1", w, u, 100)
    stacked = w.reshape(-1, w.shape[2])
    log_det, condition = paper_criteria(once)
    assert log_det == pytest.approx(np.linalg.slogdet(stacked.T @ stacked)[1], rel=1e-9)
    assert condition == pytest.approx(np.linalg.cond(stacked) ** 2, rel=1e-7)
    twice = together([once, linear(model, "a_2", w, u, 100)])
    assert paper_criteria(twice) == pytest.approx((log_det, condition), rel=1e-9)
