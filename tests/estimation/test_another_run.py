"""What a further run is expected to differ by: what many such runs do differ by."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.estimation import wls
from scara_ident.estimation.another_run import left_beside_own, of_another_run, variance_of_another_run
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.run_variation import RunVariation
from tests.diagnosis.made import NOISE, observed
from tests.estimation.test_run_variation import DIFFERENT, runs


def test_further_runs_lie_off_by_as_much():
    after = wls(observed(runs(np.random.default_rng(3), DIFFERENT, count=12, seconds=6.0)))
    assert after.variation is not None
    further = observed(runs(np.random.default_rng(4), DIFFERENT, count=20, seconds=6.0))
    apart = of_another_run(after.variation, further, after.value)
    left = np.array([item.rms(after.value) for item in further.by_joint])
    # Within the band white noise is less than on samples.
    noise = np.array(NOISE) * np.sqrt(2.0 * further.data.bands[0] / 250.0)
    assert apart == pytest.approx(np.sqrt(left**2 - noise**2), rel=0.3)


def test_runs_that_do_not_differ_lie_off_by_nothing():
    training = observed(runs(np.random.default_rng(3), (0.0,) * 4, count=3, seconds=6.0))
    nothing = RunVariation((None, None))
    assert np.array_equal(of_another_run(nothing, training, wls(training).value), np.zeros(2))


@pytest.mark.slow
def test_what_they_make_along_signals_is_as_large_as_what_many_make():
    after = wls(observed(runs(np.random.default_rng(3), DIFFERENT, count=12, seconds=6.0)))
    assert after.variation is not None
    # The same two runs many times, each with its own differences: what the noise makes of the sum is small beside them.
    draws = [observed(runs(np.random.default_rng([6, k]), DIFFERENT, count=2, seconds=6.0)) for k in range(120)]
    like = draws[0]
    # On one joint: a delay is the same on both, and counted as one of each.
    own = like.joints[0].table[0]
    signals = [own, np.zeros(like.joints[1].table.shape[1])]
    expected = variance_of_another_run(after.variation, like, after.value, signals)
    found = []
    for each in draws:
        left = [rows.table[-1] - after.value[rows.columns] @ rows.table[:-1] for rows in each.joints]
        size = min(len(left[0]), len(own))
        found.append(float(left[0][:size] @ signals[0][:size]))
    assert np.var(found) == pytest.approx(expected, rel=0.35)
    # A signal that is twice as large makes four times as much, and one that is not there nothing.
    assert variance_of_another_run(after.variation, like, after.value, [2.0 * own for own in signals]) == pytest.approx(
        4.0 * expected
    )
    nothing = [np.zeros_like(own) for own in signals]
    assert variance_of_another_run(after.variation, like, after.value, nothing) == 0.0


def test_beside_their_own_differences_further_runs_leave_noise_and_what_is_none_of_these():
    after = wls(observed(runs(np.random.default_rng(3), DIFFERENT, count=12, seconds=6.0)))
    assert after.variation is not None
    made = runs(np.random.default_rng(4), DIFFERENT, count=4, seconds=6.0)
    further = observed(made)
    noise = np.array(NOISE) * np.sqrt(2.0 * further.data.bands[0] / 250.0)

    def rms(left: tuple[np.ndarray, ...], item: Observations) -> np.ndarray:
        return np.array([np.sqrt(own @ own / rows.samples) for own, rows in zip(left, item.joints, strict=True)])

    whole = np.array([rows.rms(after.value) for rows in further.joints])
    beside = rms(left_beside_own(after.variation, further, after.value), further)
    assert np.all(whole > 3.0 * beside)
    # Delays are taken up to first order, and parameters are not sure.
    assert np.all((beside > 0.9 * noise) & (beside < 1.6 * noise))
    # What else there is stays: of a size at which it is less than runs differ by.
    other = [replace(run, effort=run.effort + 0.5 * whole[:, None] * np.sin(5.0 * run.position)) for run in made]
    lacking = observed(other)
    left = rms(left_beside_own(after.variation, lacking, after.value), lacking)
    assert np.all(left > 0.8 * np.hypot(0.5 * whole * np.sqrt(0.5), beside))
    # Blocks that count for nothing leave nothing, and say nothing of the others.
    first = (further.owner == 0).astype(float)
    alone = observed(made[:1])
    some = left_beside_own(after.variation, further, after.value, first)
    for joint, own in enumerate(left_beside_own(after.variation, alone, after.value)):
        assert some[joint][: len(own)] == pytest.approx(own, abs=1e-9)
        assert not np.any(some[joint][len(own) :])
    nothing = left_beside_own(RunVariation((None, None)), further, after.value)
    for own, rows in zip(nothing, further.joints, strict=True):
        assert np.array_equal(own, rows.left(after.value))
