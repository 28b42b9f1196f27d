"""What an examination says, against brute force, closed forms and the distribution that a p-value must have."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.signal import lfilter

from scara_ident.diagnosis.candidate_tests import ABSORBED, examine, left_over
from tests.diagnosis.made import table_of

ROWS = 1600


def slow(rng: np.random.Generator, count: int, rows: int = ROWS) -> np.ndarray:
    """Sines slower than a block, as motion is."""
    t = np.arange(rows)[:, None]
    return np.sin(2 * np.pi * t * rng.uniform(0.004, 0.03, count) + rng.uniform(0, 6, count))


@pytest.mark.parametrize("memory", [0.0, 0.8])
def test_the_p_value_is_uniform_where_nothing_is_missing(memory: float):
    rng = np.random.default_rng(1)
    found = []
    for _ in range(300):
        columns = slow(rng, 5)
        noise = lfilter([1.0], [1.0, -memory], rng.standard_normal(ROWS))
        table = table_of(columns, columns[:, :3] @ [1.0, -2.0, 0.5] + noise)
        found.append(examine(table, range(3), [[3, 4]])[0].p_value)
    p = np.sort(found)
    # Kolmogorov and Smirnov's distance; 0.094 is its 1 % quantile for 300 values.
    distance = np.max(np.abs(p - (np.arange(300) + 0.5) / 300))
    assert distance < 0.094
    assert 0.02 <= np.mean(p < 0.05) <= 0.09


def test_a_textbook_test_would_call_correlated_noise_an_effect():
    """The power of the check above: without blocks every other p-value is below 5 %."""
    rng = np.random.default_rng(1)
    low = 0
    for _ in range(100):
        columns = slow(rng, 5)
        noise = lfilter([1.0], [1.0, -0.8], rng.standard_normal(ROWS))
        low += examine(table_of(columns, noise, block=1), range(3), [[3, 4]])[0].p_value < 0.05
    assert low > 20


def test_value_gain_and_contribution_are_those_of_the_joint_fit():
    rng = np.random.default_rng(2)
    columns = slow(rng, 6)
    torque = columns @ [1.0, -2.0, 0.5, 0.3, -0.2, 0.0] + rng.standard_normal(ROWS)
    found = examine(table_of(columns, torque), [0, 1, 2], [[3, 4], [5]])
    for result, group in zip(found, ([3, 4], [5]), strict=True):
        joined = np.linalg.lstsq(columns[:, [0, 1, 2, *group]], torque)[0]
        alone = np.linalg.lstsq(columns[:, :3], torque)[0]
        assert_allclose(result.value, joined[3:], rtol=1e-7)
        assert_allclose(result.model_value, joined[:3], rtol=1e-7)
        before = np.sum((torque - columns[:, :3] @ alone) ** 2)
        after = np.sum((torque - columns[:, [0, 1, 2, *group]] @ joined) ** 2)
        assert result.gain == pytest.approx(1.0 - after / before, rel=1e-6)
        assert result.contribution == pytest.approx(before - after, rel=1e-6)


def test_the_standard_deviation_is_the_scatter_of_repeated_estimates():
    rng = np.random.default_rng(3)
    columns = slow(rng, 4)
    found = []
    for _ in range(200):
        noise = lfilter([1.0], [1.0, -0.8], rng.standard_normal(ROWS))
        found.append(examine(table_of(columns, noise), range(3), [[3]])[0])
    scatter = np.std([item.value[0] for item in found])
    told = np.sqrt(np.mean([item.covariance[0, 0] for item in found]))
    assert told == pytest.approx(scatter, rel=0.2)


def test_what_the_model_spans_is_absorbed_and_says_nothing():
    rng = np.random.default_rng(4)
    own = slow(rng, 3)
    columns = np.column_stack([own, own @ [1.0, 2.0, 3.0], own @ [1e-6, 0.0, 1e-6]])
    torque = rng.standard_normal(ROWS)
    for result in examine(table_of(columns, torque), range(3), [[3], [4], [3, 4]]):
        assert result.outside < ABSORBED
        assert (result.p_value, result.gain, result.held_out, result.votes) == (1.0, 0.0, 0.0, (0, 0))
        assert np.all(result.value == 0.0)
        assert np.all(np.isinf(result.covariance))


def test_the_share_outside_the_model_is_the_sine_of_the_angle_squared():
    model, other = np.zeros(ROWS), np.zeros(ROWS)
    model[::2], other[1::2] = 1.0, 1.0
    candidate = np.cos(0.3) * model + np.sin(0.3) * other
    table = table_of(np.column_stack([model, candidate]), np.random.default_rng(5).standard_normal(ROWS))
    assert examine(table, [0], [[1]])[0].outside == pytest.approx(np.sin(0.3) ** 2)


def test_the_gain_held_out_is_that_of_leaving_one_trajectory_out():
    rng = np.random.default_rng(6)
    columns = slow(rng, 4)
    torque = columns @ [1.0, 0.0, 2.0, 0.4] + rng.standard_normal(ROWS)
    result = examine(table_of(columns, torque), [0, 1, 2], [[3]])[0]
    clean = [x - columns[:, :3] @ np.linalg.lstsq(columns[:, :3], x)[0] for x in (columns[:, 3], torque)]
    saved, gains = 0.0, []
    for fold in np.split(np.arange(ROWS), 4):
        rest = np.setdiff1d(np.arange(ROWS), fold)
        guess = clean[0][rest] @ clean[1][rest] / (clean[0][rest] @ clean[0][rest])
        base = np.sum(clean[1][fold] ** 2)
        saving = base - np.sum((clean[1][fold] - guess * clean[0][fold]) ** 2)
        gains.append(saving / base)
        saved += saving
    assert_allclose(result.fold_gains, gains, rtol=1e-6)
    assert result.held_out == pytest.approx(saved / np.sum(clean[1] ** 2), rel=1e-6)
    assert result.held_out < result.gain


def test_a_trajectory_that_does_not_excite_a_candidate_abstains():
    rng = np.random.default_rng(7)
    columns = slow(rng, 3)
    columns[800:1200, 2] = 0.0
    columns[:, :2] = rng.standard_normal((ROWS, 2))
    torque = columns @ [1.0, 2.0, 1.0] + 0.5 * rng.standard_normal(ROWS)
    result = examine(table_of(columns, torque), [0, 1], [[2]])[0]
    assert result.fold_gains[2] is None
    assert result.votes == (3, 3)


def test_what_helps_in_one_trajectory_and_harms_in_the_others_gains_nothing_held_out():
    rng = np.random.default_rng(8)
    columns = slow(rng, 3)
    torque = 0.1 * rng.standard_normal(ROWS)
    torque[:400] += columns[:400, 2]
    torque[400:] -= 0.3 * columns[400:, 2]
    result = examine(table_of(columns, torque), [0, 1], [[2]])[0]
    assert result.held_out < 0.0


def test_nothing_is_found_in_torque_that_the_model_explains_exactly():
    columns = slow(np.random.default_rng(9), 3)
    result = examine(table_of(columns, np.zeros(ROWS)), [0, 1], [[2]])[0]
    assert (result.p_value, result.gain) == (1.0, 0.0)


def test_units_of_columns_change_nothing():
    rng = np.random.default_rng(10)
    columns = slow(rng, 5)
    torque = columns @ [1.0, 0.0, 2.0, 0.1, 0.1] + rng.standard_normal(ROWS)
    unit = np.array([1e6, 1.0, 1e-6, 1e-7, 1e5])
    one = examine(table_of(columns, torque), range(3), [[3, 4]])[0]
    two = examine(table_of(columns * unit, torque), range(3), [[3, 4]])[0]
    assert_allclose(two.value * unit[3:], one.value, rtol=1e-6)
    assert_allclose([two.p_value, two.gain, two.held_out], [one.p_value, one.gain, one.held_out], rtol=1e-6)


def test_what_is_left_over_is_the_residual_of_every_block():
    rng = np.random.default_rng(11)
    columns = slow(rng, 3)
    torque = rng.standard_normal(ROWS)
    rest = torque - columns @ np.linalg.lstsq(columns, torque)[0]
    assert_allclose(left_over(table_of(columns, torque)), np.sum(rest.reshape(-1, 40) ** 2, axis=1), rtol=1e-8)
