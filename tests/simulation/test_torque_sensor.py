"""The measured torque against formulas."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.simulation import virtual_arm
from scara_ident.simulation.torque_sensor import recorded_effort


def test_a_ramp_is_measured_late_scaled_shifted_and_drifting() -> None:
    arm = virtual_arm()
    draft = arm.draft()
    period, n = 1e-3, 200
    time = period * np.arange(n)
    effort = np.array([2.0 * time, np.full(n, 0.5)])
    draft.delay[:], draft.gain[:], draft.shift[:], draft.drift[:] = 3e-3, 1.5, 0.1, 0.2
    draft.cubic[1] = 0.4
    seen = recorded_effort(arm, draft, effort, np.zeros((2, n)), period, 1)
    inside = slice(10, -10)
    # Held from tick to tick and averaged about a tick, a ramp comes half a period late, and the delay is 3 ms.
    expected = 1.5 * 2.0 * (time - 3.5e-3) + 0.1 + 0.2 * time
    assert seen[0, inside] == pytest.approx(expected[inside], abs=1e-12)
    assert seen[1, inside] == pytest.approx((1.5 * (0.5 + 0.4 * 0.125) + 0.1 + 0.2 * time)[inside], abs=1e-12)


def test_a_filter_is_that_of_first_order_by_its_mean_over_each_period() -> None:
    arm = virtual_arm()
    draft = arm.draft()
    period, n, time_constant = 1e-3, 400, 7e-3
    time = period * np.arange(n)
    effort = np.array([np.where(time < 0.1, 1.0, 3.0), 1.0 + np.sin(40.0 * time)])
    draft.lag[:] = time_constant
    seen = recorded_effort(arm, draft, effort, np.zeros((2, n)), period, 1)
    # Closed form of a step, averaged about the tick: from half a period before to half a period after.
    after = np.flatnonzero(time >= 0.1)[2:]
    ends = [np.exp(-(time[after] - 0.1 + side * period / 2.0) / time_constant) for side in (-1.0, 1.0)]
    mean = 3.0 - 2.0 * time_constant / period * (ends[0] - ends[1])
    # The mean of two halves of exact means of whole periods: their curvature is left out.
    assert seen[0, after] == pytest.approx(mean, abs=2.0 * (period / time_constant) ** 2 / 8.0)
    assert seen[0, time < 0.09] == pytest.approx(1.0)
    # Of a tone gain and phase; held from tick to tick it is half a period later, and means take some of it.
    turned = 1.0 / (1.0 + 40.0j * time_constant)
    expected = 1.0 + np.imag(turned * np.exp(40.0j * (time - period / 2.0)))
    assert seen[1, 100:-2] == pytest.approx(expected[100:-2], abs=0.25 * (40.0 * period) ** 2)
