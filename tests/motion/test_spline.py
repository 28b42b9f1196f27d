"""The cubic spline against SciPy's, and against cubics, which it reproduces."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import CubicSpline

from scara_ident.motion.spline import cubic_spline


@pytest.mark.parametrize("count", [4, 5, 400])
def test_it_is_scipys(count: int):
    rng = np.random.default_rng(count)
    time = np.cumsum(rng.uniform(0.2, 1.8, count))
    signals = rng.standard_normal((3, count))
    at = np.concatenate([rng.uniform(time[0], time[-1], 1000), time, [time[0] - 0.1, time[-1] + 0.1]])
    assert_allclose(cubic_spline(time, signals, at), CubicSpline(time, signals, axis=1)(at), rtol=0, atol=1e-11)


def test_a_cubic_is_itself():
    time = np.array([0.0, 0.3, 1.0, 1.2, 2.5, 2.9])
    at = np.linspace(-0.5, 3.5, 50)
    cubic = np.polynomial.Polynomial([1.0, -2.0, 0.5, 0.25])
    assert_allclose(cubic_spline(time, cubic(time)[None], at)[0], cubic(at), rtol=1e-12, atol=1e-12)
