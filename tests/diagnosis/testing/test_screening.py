"""What a remainder depends on is found where it was planted, and nowhere in noise."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.diagnosis.testing.screening import screen
from tests.diagnosis.made import complete, exact_runs, fitted, residuals_of, with_torque

MODEL = complete()


def screened(runs):
    return screen(MODEL, residuals_of(fitted(exact_runs()).value, runs))


def test_nothing_is_found_in_noise():
    assert screened(exact_runs())[0].explained < 0.02


def test_a_planted_signal_comes_first_with_its_size():
    found = screened(with_torque(exact_runs(), 1, lambda motion: 0.02 * np.sin(6.0 * motion.q[1])))
    single = next(item for item in found if len(item.signals) == 1)
    assert (single.joint, single.signals) == ("joint2", ("position of joint2",))
    assert single.explained > 0.8
    assert single.rms == pytest.approx(0.02 / np.sqrt(2.0), rel=0.15)
    assert found[0].joint == "joint2"
    assert "position of joint2" in found[0].signals
    assert max(item.explained for item in found if item.joint == "joint1") < 0.02


def test_a_planted_pair_comes_first_and_beats_its_halves():
    def added(motion):
        return 0.03 * np.sin(3.0 * motion.q[0]) * np.sign(motion.v[1])

    found = screened(with_torque(exact_runs(), 0, added))
    assert found[0].joint == "joint1"
    assert set(found[0].signals) == {"position of joint1", "velocity of joint2"}
    best_single = max(item.explained for item in found if len(item.signals) == 1)
    assert found[0].explained > 1.2 * best_single


def test_they_are_ranked():
    explained = [item.explained for item in screened(exact_runs())]
    assert explained == sorted(explained, reverse=True)


def test_what_repeats_in_one_trajectory_only_is_not_called_a_dependence():
    """Judged on the rows that the bins come from, it would be."""
    runs = exact_runs()
    planted = with_torque(runs[:2], 0, lambda motion: 0.02 * np.sin(6.0 * motion.q[0]))
    opposite = with_torque(runs[2:], 0, lambda motion: -0.02 * np.sin(6.0 * motion.q[0]))
    position = next(
        item
        for item in screened([*planted, *opposite])
        if (item.joint, item.signals) == ("joint1", ("position of joint1",))
    )
    assert position.explained < 0.0


def test_one_trajectory_is_judged_by_its_parts():
    runs = exact_runs(1, 4)
    planted = with_torque(runs, 1, lambda motion: 0.02 * np.sin(6.0 * motion.q[1]))
    found = screen(MODEL, residuals_of(fitted(runs).value, planted))
    assert "position of joint2" in found[0].signals
    assert found[0].explained > 0.5


def test_too_few_samples_for_the_bins_say_nothing():
    runs = with_torque(exact_runs()[:1], 1, lambda motion: 0.02 * np.sin(6.0 * motion.q[1]))
    assert screened(runs) == ()
