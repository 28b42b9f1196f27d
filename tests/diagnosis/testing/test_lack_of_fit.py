"""What repeats against what does not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.diagnosis.testing.lack_of_fit import lack_of_fit
from scara_ident.motion.low_pass import low_pass
from tests.diagnosis.made import BANDS, exact_runs, fitted, residuals_of, with_torque


def test_noise_alone_is_not_a_lack_of_fit():
    runs = exact_runs(2, 3)
    for fit in lack_of_fit(residuals_of(fitted(runs).value, runs)):
        assert fit.p_value > 0.01
        assert fit.missing < 0.5 * fit.noise


def test_the_noise_is_the_recorded_one_within_the_band():
    runs = exact_runs(2, 3)
    noise = [fit.noise for fit in lack_of_fit(residuals_of(fitted(runs).value, runs))]
    white = low_pass(np.random.default_rng(0).standard_normal((1, 100_000)), 250.0, BANDS[0])[0].std()
    assert noise == pytest.approx([0.02 * white, 0.008 * white], rel=0.1)


def test_a_planted_remainder_is_found_at_its_size_on_its_joint():
    runs = with_torque(exact_runs(), 0, lambda motion: 0.02 * np.sin(7.0 * motion.q[0] + 3.0 * motion.q[1]))
    value = fitted(exact_runs()).value
    one, other = lack_of_fit(residuals_of(value, runs))
    planted = np.concatenate([0.02 * np.sin(7.0 * run.position[0] + 3.0 * run.position[1]) for run in exact_runs()])
    assert one.joint == "joint1"
    assert one.missing == pytest.approx(np.sqrt(np.mean(planted**2)), rel=0.15)
    assert one.p_value < 1e-12
    assert other.p_value > 0.01
    clean = lack_of_fit(residuals_of(value, exact_runs()))
    assert one.noise == pytest.approx(clean[0].noise, rel=1e-3)


def test_the_trajectory_with_the_remainder_is_named():
    runs = exact_runs()
    planted = with_torque(runs[2:], 1, lambda motion: 0.02 * np.sin(9.0 * motion.q[1]))
    fit = lack_of_fit(residuals_of(fitted(runs).value, [*runs[:2], *planted]))[1]
    by = dict(fit.by_trajectory)
    assert by["B"] > 5.0 * by["A"]


def test_runs_that_start_at_other_times_are_aligned():
    second = exact_runs()[1]
    late = replace(second, time=second.time[25:], position=second.position[:, 25:], effort=second.effort[:, 25:])
    value = fitted(exact_runs()).value
    pair = with_torque([exact_runs()[0], late], 0, lambda motion: 0.02 * np.sin(7.0 * motion.q[0]))
    fit = lack_of_fit(residuals_of(value, pair))[0]
    usual = lack_of_fit(residuals_of(value, exact_runs()[:2]))[0]
    assert fit.noise == pytest.approx(usual.noise, rel=0.1)
    assert fit.missing == pytest.approx(0.02 / np.sqrt(2.0), rel=0.25)


def test_without_repetitions_nothing_is_said():
    runs = exact_runs()[::2]
    assert lack_of_fit(residuals_of(fitted(runs).value, runs)) == ()
