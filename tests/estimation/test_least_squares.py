"""Ordinary and weighted least squares against NumPy on the stacked rows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from scara_ident.errors import EstimationError, UsageError
from scara_ident.estimation import ols, wls
from scara_ident.estimation.information import joint_noise
from scara_ident.estimation.least_squares import value_and_weights, weighted_value
from scara_ident.estimation.observations import observe
from scara_ident.model.model import TorqueModel
from scara_ident.motion.prepared import prepare
from tests.estimation.made import linear, rows, together, two_joint_model

NOISE = np.array([0.5, 0.01])


@pytest.fixture(scope="module")
def model(tmp_path_factory: pytest.TempPathFactory) -> TorqueModel:
    return two_joint_model(tmp_path_factory.mktemp("arm"))


def made(model: TorqueModel, seed: int = 0, count: int = 4000) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    w = rows(rng, model, count)
    truth = np.arange(1.0, w.shape[2] + 1)
    return w, w @ truth + NOISE[:, None] * rng.standard_normal((2, count)), truth


def test_ols_is_numpys_least_squares_over_all_recordings_and_joints(model: TorqueModel):
    w, u, _ = made(model)
    parts = [linear(model, "a_1", w[:, :1500], u[:, :1500], 100), linear(model, "a_2", w[:, 1500:], u[:, 1500:], 130)]
    expected = np.linalg.lstsq(w.reshape(-1, w.shape[2]), u.ravel(), rcond=None)[0]
    for given in (parts, parts[::-1]):
        found = ols(together(given))
        assert_allclose(found.value, expected, rtol=1e-10)
        assert found.method == "ols"
        assert found.std_kind == "block"
        assert not found.undetermined.any()
        assert_allclose(found.weights, 1.0)
        assert found.information.rows == 8000


def test_wls_divides_each_joints_rows_by_its_noise_once(model: TorqueModel):
    """Not by its square, and not by its root."""
    w, u, _ = made(model)
    scaled_w, scaled_u = w / NOISE[:, None, None], u / NOISE[:, None]
    expected = np.linalg.lstsq(scaled_w.reshape(-1, w.shape[2]), scaled_u.ravel(), rcond=None)[0]
    found = wls(linear(model, "a_1", w, u, 100), NOISE)
    assert_allclose(found.value, expected, rtol=1e-10)
    assert found.method == "wls"


def test_wls_without_given_noise_finds_it_in_the_residual(model: TorqueModel):
    rng = np.random.default_rng(0)
    w, sigma = rows(rng, model, 4000), np.array([0.05, 0.01])
    given = linear(model, "a_1", w, w.sum(axis=2) + sigma[:, None] * rng.standard_normal((2, 4000)), 100)
    assert_allclose(joint_noise(given.by_joint), sigma, rtol=0.05)
    one, other = wls(given), wls(given, sigma)
    assert np.all(np.abs(one.value - other.value) < 0.2 * other.std + 1e-12)


def test_wls_gains_on_ols_where_joints_differ_in_noise(model: TorqueModel):
    errors = {"ols": [], "wls": []}
    for seed in range(12):
        w, u, truth = made(model, seed, 1500)
        given = linear(model, "a_1", w, u, 50)
        errors["ols"].append(ols(given).value - truth)
        errors["wls"].append(wls(given).value - truth)
    rms = {name: np.sqrt(np.mean(np.square(error), axis=0)) for name, error in errors.items()}
    shared = np.flatnonzero(model.pattern.all(axis=0))
    assert shared.size
    assert np.all(rms["wls"][shared] < 0.2 * rms["ols"][shared])


def test_wls_of_an_exact_fit_is_the_truth(model: TorqueModel):
    rng = np.random.default_rng(0)
    w = rows(rng, model, 500)
    truth = np.arange(1.0, w.shape[2] + 1)
    assert_allclose(wls(linear(model, "a_1", w, w @ truth, 100)).value, truth, rtol=1e-8)


@pytest.mark.parametrize("noise", [[1.0], np.ones((2, 2)), 3.0])
def test_wls_refuses_noise_that_is_not_one_number_a_joint(model: TorqueModel, noise):
    w, u, _ = made(model, count=300)
    with pytest.raises(UsageError, match="expected one number for each of j1, j2"):
        wls(linear(model, "a_1", w, u, 100), noise)


@pytest.mark.parametrize("noise", [np.array([0.0, 1.0]), np.array([1.0, np.nan]), np.array([-1.0, 1.0])])
def test_wls_refuses_noise_that_is_none(model: TorqueModel, noise: np.ndarray):
    w, u, _ = made(model, count=300)
    with pytest.raises(EstimationError, match="noise of joint"):
        wls(linear(model, "a_1", w, u, 100), noise)


@pytest.mark.slow
@pytest.mark.parametrize(("method", "sigma"), [(ols, (0.02, 0.008)), (wls, (0.02, 0.008)), (wls, (0.5, 0.01))])
def test_reported_std_is_the_spread_of_estimates(model: TorqueModel, method, sigma: tuple[float, float]):
    w = rows(np.random.default_rng(1), model, 3000)
    values, stds = [], []
    for seed in range(60):
        u = w.sum(axis=2) + np.array(sigma)[:, None] * np.random.default_rng(seed).standard_normal((2, 3000))
        found = method(linear(model, "a_1", w, u, 75))
        values.append(found.value)
        stds.append(found.std)
    spread = np.std(values, axis=0, ddof=1)
    assert_allclose(np.sqrt(np.mean(np.square(stds), axis=0)), spread, rtol=0.3)


def test_an_undetermined_parameter_has_infinite_std_and_the_others_keep_theirs(model: TorqueModel):
    w, u, truth = made(model)
    names = list(model.names)
    dead = names.index("a12")
    u = u - w[:, :, dead] * truth[dead]
    w[:, :, dead] = 0.0
    found = ols(linear(model, "a_1", w, u, 100))
    assert [name for name, open_ in zip(names, found.undetermined, strict=True) if open_] == ["a12"]
    assert found.std[dead] == np.inf
    assert np.all(np.isfinite(np.delete(found.std, dead)))
    alive = np.delete(np.arange(len(names)), dead)
    expected = np.linalg.lstsq(w.reshape(-1, len(names))[:, alive], u.ravel(), rcond=None)[0]
    assert_allclose(found.value[alive], expected, rtol=1e-9)


def test_the_value_alone_is_that_of_wls(model: TorqueModel):
    w, u, _ = made(model)
    given = linear(model, "a_1", w, u, 100)
    np.testing.assert_array_equal(weighted_value(given.by_joint), wls(given).value)
    np.testing.assert_array_equal(value_and_weights(given)[1], wls(given).weights)


def test_nothing_to_estimate_from_is_an_error(model: TorqueModel):
    nothing = observe(model, prepare([]))
    with pytest.raises(EstimationError, match="no recording"):
        ols(nothing)
    with pytest.raises(EstimationError, match="no recording"):
        wls(nothing)


def test_the_order_of_magnitude_of_units_does_not_change_the_estimate(model: TorqueModel, tmp_path: Path):
    w, u, _ = made(model)
    unit = 10.0 ** np.random.default_rng(0).uniform(-4, 4, w.shape[2])
    one, other = ols(linear(model, "a_1", w, u, 100)), ols(linear(model, "a_1", w * unit, u, 100))
    assert_allclose(other.value * unit, one.value, rtol=1e-9)
    assert_allclose(other.std * unit, one.std, rtol=1e-6)
