"""Noise has the distribution asked for, and a run differs from the arm in what it is said to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.errors import UsageError
from scara_ident.simulation import RunState, TorqueNoise, simulate
from tests.simulation.made import friction, rigid, scara, swing

RATE = 500.0
USUAL = RunState(np.ones(2), np.ones(2), np.zeros(2))


@pytest.mark.parametrize("kind", ["white", "coloured", "heavy"])
def test_noise_has_unit_variance(kind: str) -> None:
    noise = TorqueNoise(kind, 0.02).draw(np.random.default_rng(1), (2, 200_000), RATE)
    # Half of a standard deviation is from the tails where these are heavy: its estimate scatters by some per cent.
    np.testing.assert_allclose(noise.std(axis=1), 1.0, rtol=0.15 if kind == "heavy" else 0.02)
    assert abs(np.corrcoef(noise)[0, 1]) < 0.02


def test_coloured_noise_forgets_within_its_correlation_time_from_the_first_sample_on() -> None:
    noise = TorqueNoise("coloured", 0.02).draw(np.random.default_rng(2), (20_000, 11), RATE)
    # Over many draws, so that the start counts too: exp(-lag / correlation time).
    for lag in (1, 5, 10):
        together = np.mean(noise[:, 0] * noise[:, lag])
        assert together == pytest.approx(np.exp(-lag / RATE / 0.02), abs=0.03)
    np.testing.assert_allclose(noise.std(axis=0), 1.0, rtol=0.03)


def test_heavy_noise_has_outliers_that_a_normal_one_lacks() -> None:
    draw = np.random.default_rng(3)
    heavy, white = (TorqueNoise(kind).draw(draw, (1, 100_000), RATE) for kind in ("heavy", "white"))
    assert np.mean(np.abs(heavy) > 5.0) > 1e-3
    assert np.mean(np.abs(white) > 5.0) < 1e-4


@pytest.mark.parametrize(
    ("noise", "line"),
    [(("pink", 0.01), "expected white, coloured or heavy"), (("coloured", 0.0), "expected a positive number")],
)
def test_noise_that_is_none_is_refused_in_one_line(noise: tuple[str, float], line: str) -> None:
    with pytest.raises(UsageError, match=line):
        TorqueNoise(*noise)


def test_the_usual_run_is_the_arm_itself() -> None:
    arm = scara()
    motion = swing(arm.robot, 0.5)
    plain, usual = (simulate(arm, motion, run=run).recording for run in (None, USUAL))
    np.testing.assert_array_equal(plain.effort, usual.effort)
    np.testing.assert_array_equal(plain.position, usual.position)


def test_friction_of_a_run_is_the_arms_times_its_factors() -> None:
    arm = scara()
    factor = np.array([1.2, 0.7])
    run = replace(USUAL, friction=factor)
    true = simulate(arm, swing(arm.robot, 2.0), run=run).true
    u = true.effort - rigid(arm, true.position, true.velocity, true.acceleration)
    moving = true.direction != 0.0
    expected = factor[:, None] * friction(arm, true.velocity, true.direction)
    np.testing.assert_allclose(u[moving], expected[moving], atol=1e-10)


def test_scale_offset_and_delay_of_a_run_are_in_the_record_and_not_in_the_motion() -> None:
    arm = scara()
    motion = swing(arm.robot, 1.0)
    plain = simulate(arm, motion)
    run = RunState(np.ones(2), np.array([1.02, 0.97]), np.array([0.01, -0.02]), delay=0.003)
    other = simulate(arm, motion, run=run)
    np.testing.assert_array_equal(other.true.effort, plain.true.effort)
    late = plain.recording.effort[:, :-3]
    expected = run.torque_scale[:, None] * late + run.torque_offset[:, None]
    np.testing.assert_allclose(other.recording.effort[:, 3:], expected, atol=1e-12)
