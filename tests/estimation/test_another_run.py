"""What a further run is expected to differ by: what many such runs do differ by."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.estimation import wls
from scara_ident.estimation.another_run import of_another_run, variance_of_another_run
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
