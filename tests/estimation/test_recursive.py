"""Recursive least squares against the batch and against the textbook recursion of the covariance."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from scara_ident.errors import EstimationError, UsageError
from scara_ident.estimation import ols, rls
from scara_ident.estimation.information import Information
from scara_ident.estimation.observations import observe
from scara_ident.model.model import TorqueModel
from scara_ident.motion.prepared import prepare
from tests.estimation.made import linear, rows, together, two_joint_model


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> TorqueModel:
    return two_joint_model(tmp_path_factory.mktemp("arm"))


def made(model: TorqueModel, seed: int = 0, count: int = 2000, noise: float = 0.1) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    w = rows(rng, model, count)
    return w, w @ np.arange(1.0, w.shape[2] + 1) + noise * rng.standard_normal((2, count))


def textbook(
    w: np.ndarray, u: np.ndarray, mean: np.ndarray, covariance: np.ndarray, forgetting: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Gain, innovation and covariance update, a sample (all joints) at a time; noise of unit variance."""
    value, p = mean.copy(), covariance.copy()
    for k in range(u.shape[1]):
        h = w[:, k]
        gain = p @ h.T @ np.linalg.inv(h @ p @ h.T + forgetting * np.eye(len(h)))
        value = value + gain @ (u[:, k] - h @ value)
        p = (p - gain @ h @ p) / forgetting
    return value, p


def test_without_prior_and_forgetting_the_last_estimate_is_ols(model: TorqueModel):
    w, u = made(model)
    parts = [linear(model, "a_1", w[:, :900], u[:, :900], 50), linear(model, "a_2", w[:, 900:], u[:, 900:], 70)]
    given = together(parts)
    found, history = rls(given)
    batch = ols(given)
    assert found.method == "rls"
    assert_allclose(found.value, batch.value, rtol=1e-10)
    assert_allclose(history.value[-1], batch.value, rtol=1e-10)
    assert_allclose(found.covariance, batch.covariance, rtol=1e-10)
    assert history.samples[-1] == pytest.approx(2000)
    assert history.log_det[-1] == pytest.approx(found.information.log_det(), rel=1e-12)


def test_with_a_prior_it_is_the_textbook_recursion(model: TorqueModel):
    w, u = made(model, count=300, noise=1.0)
    p = w.shape[2]
    rng = np.random.default_rng(5)
    mean, std = rng.standard_normal(p), rng.uniform(0.2, 3.0, p)
    expected, covariance = textbook(w, u, mean, np.diag(std**2))
    found, history = rls(linear(model, "a_1", w, u, 1), prior=Information.prior(mean, std))
    assert_allclose(found.value, expected, rtol=1e-9)
    assert_allclose(history.value[-1], expected, rtol=1e-9)
    assert_allclose(found.information.inverse(), covariance, rtol=1e-8)
    half, _ = textbook(w[:, :120], u[:, :120], mean, np.diag(std**2))
    assert_allclose(history.value[119], half, rtol=1e-9)


def test_with_prior_and_forgetting_it_is_the_textbook_recursion(model: TorqueModel):
    w, u = made(model, count=200, noise=1.0)
    p = w.shape[2]
    mean, std = np.zeros(p), np.full(p, 2.0)
    expected, covariance = textbook(w, u, mean, np.diag(std**2), forgetting=0.99)
    found, history = rls(linear(model, "a_1", w, u, 1), prior=Information.prior(mean, std), forgetting=0.99)
    assert_allclose(history.value[-1], expected, rtol=1e-8)
    assert_allclose(found.value, expected, rtol=1e-8)
    assert_allclose(found.information.inverse(), covariance, rtol=1e-8)


def test_forgetting_follows_a_parameter_that_changed(model: TorqueModel):
    w, u = made(model, noise=0.01)
    truth = np.arange(1.0, w.shape[2] + 1)
    changed = truth + 5.0
    u[:, 1000:] += 5.0 * w[:, 1000:].sum(axis=2)
    given = linear(model, "a_1", w, u, 20)
    held, _ = rls(given)
    followed, history = rls(given, forgetting=0.98)
    assert np.all(np.abs(held.value - changed) > 0.5)
    assert_allclose(followed.value, changed, atol=0.1)
    assert_allclose(history.value[-1], followed.value, rtol=1e-9)
    assert_allclose(history.value[49], truth, atol=0.1)


def test_old_blocks_weigh_less_the_older_they_are(model: TorqueModel):
    w, u = made(model, count=100)
    found, _ = rls(linear(model, "a_1", w, u, 10), forgetting=0.95)
    weight = 0.95 ** (100.0 - 10.0 * (np.arange(100) // 10 + 1))
    expected = np.einsum("jkp,k,jkq->pq", w, weight, w)
    assert_allclose(found.information.regressor_factor.T @ found.information.regressor_factor, expected, atol=1e-10)
    assert found.information.rows == pytest.approx(2 * weight.sum())


def test_the_history_of_jd_never_falls_and_begins_at_minus_infinity(model: TorqueModel):
    w, u = made(model, count=400)
    _, history = rls(linear(model, "a_1", w, u, 2))
    assert history.log_det[0] == -np.inf
    assert np.isnan(history.value[0]).any()
    known = np.isfinite(history.log_det)
    assert known[-1]
    assert np.all(np.diff(known.astype(int)) >= 0)
    assert np.all(np.diff(history.log_det[known]) >= -1e-9)
    assert np.all(np.isfinite(history.value[known]))
    np.testing.assert_array_equal(history.samples, np.arange(2, 401, 2))


def test_the_history_of_std_falls_to_the_white_formula(model: TorqueModel):
    w, u = made(model)
    found, history = rls(linear(model, "a_1", w, u, 50))
    stacked = w.reshape(-1, w.shape[2])
    residual = u.ravel() - stacked @ found.value
    expected = np.sqrt(residual @ residual / (len(residual) - w.shape[2]) * np.diag(np.linalg.inv(stacked.T @ stacked)))
    assert_allclose(history.std[-1], expected, rtol=1e-8)
    assert np.all(history.std[-1] < history.std[12])


def test_a_parameter_only_the_prior_knows_keeps_the_priors_std(model: TorqueModel):
    w, u = made(model, noise=1.0)
    dead = list(model.names).index("a12")
    w[:, :, dead] = 0.0
    mean, std = np.zeros(w.shape[2]), np.full(w.shape[2], np.inf)
    mean[dead], std[dead] = 3.0, 0.7
    found, _ = rls(linear(model, "a_1", w, u, 20), prior=Information.prior(mean, std))
    assert found.value[dead] == pytest.approx(3.0)
    assert not found.undetermined[dead]
    assert found.std[dead] == pytest.approx(0.7, rel=1e-9)
    # The others are as unsure as their data make them.
    free, _ = rls(linear(model, "a_1", w, u, 20))
    others = np.arange(w.shape[2]) != dead
    assert_allclose(found.std[others], free.std[others], rtol=1e-6)


@pytest.mark.parametrize("forgetting", [0.0, -0.1, 1.1, np.nan])
def test_forgetting_is_a_factor_up_to_one(model: TorqueModel, forgetting: float):
    w, u = made(model, count=20)
    with pytest.raises(UsageError, match="expected a factor per sample"):
        rls(linear(model, "a_1", w, u, 10), forgetting=forgetting)


def test_nothing_to_estimate_from_is_an_error(model: TorqueModel):
    with pytest.raises(EstimationError, match="no recording"):
        rls(observe(model, prepare([])))
