"""Of two runs, what each is taken to have of its own."""

from __future__ import annotations

import numpy as np
from numpy.testing import assert_allclose

from scara_ident.estimation import wls
from scara_ident.estimation.assumed_variation import (
    ASSUMED_DELAY,
    ASSUMED_FRICTION,
    ASSUMED_OFFSET,
    ASSUMED_SCALE,
    assumed_variation,
)
from tests.diagnosis.made import observed
from tests.estimation.test_run_variation import runs


def test_of_two_runs_friction_an_offset_and_a_delay_of_their_own_are_taken_to_be_noise():
    seen = observed(runs(np.random.default_rng(0), (0.0,) * 4, count=2))
    item = assumed_variation(seen, seen.joints, wls(seen).value).joints[0]
    assert item is not None
    offset = ASSUMED_OFFSET * np.sqrt(np.mean(item.directions[1] ** 2))
    assert_allclose(item.std, [ASSUMED_FRICTION, 0.0, offset, ASSUMED_DELAY])
    of_days = assumed_variation(seen, seen.joints, wls(seen).value, ASSUMED_SCALE).joints[0]
    assert of_days is not None
    assert_allclose(of_days.std, [ASSUMED_FRICTION, ASSUMED_SCALE, offset, ASSUMED_DELAY])
    # More friction and another offset in the second run say nothing; noise says as much as ever.
    second = np.arange(item.directions.shape[1]) >= item.bounds[1]
    told = np.vstack([item.directions[[0, 2]] * second, np.random.default_rng(1).standard_normal((1, len(second)))])
    left = np.linalg.norm(item.whitened(told), axis=1) / np.linalg.norm(told, axis=1)
    assert np.all(left[:2] < 0.1)
    assert left[2] > 0.98
