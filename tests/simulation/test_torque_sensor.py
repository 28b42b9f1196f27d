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
