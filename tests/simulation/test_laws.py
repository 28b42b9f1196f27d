"""How fast a path is gone through."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.simulation.laws import MotionLaw


@pytest.mark.parametrize("law", [MotionLaw("quintic", passes=3), MotionLaw("trapezoidal", 0.2, 2, 0.3)])
def test_motion_laws_go_the_whole_way_and_differentiate(law: MotionLaw) -> None:
    time = np.linspace(0.0, 3.0, 30001)
    s, rate, change = law(time, 3.0)
    assert s[0] == 0.0
    assert s[-1] == pytest.approx(law.passes % 2, abs=1e-12)
    assert s.min() >= 0.0
    assert s.max() == pytest.approx(1.0, abs=1e-7)
    np.testing.assert_allclose(np.gradient(s, time)[1:-1], rate[1:-1], atol=2e-3)
    smooth = np.abs(np.diff(change, prepend=0.0)) < 0.05 * np.abs(change).max()
    smooth &= np.roll(smooth, 1) & np.roll(smooth, -1)
    np.testing.assert_allclose(np.gradient(rate, time)[smooth][1:-1], change[smooth][1:-1], atol=2e-2)
