"""What a further run is expected to differ by: what many such runs do differ by."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.estimation import wls
from scara_ident.estimation.another_run import of_another_run
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
