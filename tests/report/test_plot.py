"""What a figure is made of."""

from __future__ import annotations

import base64

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scara_ident.report.plot import Grid, Line, envelope, packed


@settings(max_examples=40)
@given(
    st.lists(st.floats(-1e3, 1e3), min_size=1, max_size=60),
    st.integers(1, 9),
)
def test_an_envelope_loses_no_peak(values, bucket):
    signal = np.array(values)
    found = envelope(signal, bucket).reshape(-1, 2)
    for k, pair in enumerate(found):
        part = signal[k * bucket : (k + 1) * bucket]
        assert sorted(pair) == [part.min(), part.max()]


@settings(max_examples=20)
@given(st.integers(0, 2**31 - 1), st.floats(-1e6, 1e6), st.floats(1e-6, 1e6))
def test_packed_numbers_are_within_a_65000th_of_their_range(seed, middle, size):
    values = middle + size * np.random.default_rng(seed).standard_normal(1000)
    values[7] = np.nan
    found = packed(values)
    whole = np.frombuffer(base64.b64decode(found["q"]), dtype="<i2").astype(float)
    assert whole[7] == -32768
    back = found["offset"] + found["scale"] * whole
    finite = np.arange(1000) != 7
    assert np.max(np.abs(back - values)[finite]) <= np.ptp(values[finite]) / 65000 + 1e-9 * abs(middle)


def test_a_thinned_line_keeps_its_peak_and_its_span():
    signal = np.zeros(1000)
    signal[617] = 5.0
    line = Line(Grid(2.0, 0.01, 1000), signal, "blue", "x").thinned(10)
    x = line.x.values()
    assert len(line.y) == len(x) == 200
    assert x[np.argmax(line.y)] == pytest.approx(2.0 + 6.17, abs=0.05)
    assert (x[0], x[-1]) == pytest.approx((2.0, 2.0 + 9.99), abs=0.05)


def test_what_a_layer_leaves_at_its_default_is_not_written():
    assert Line([0.0, 1.0], [2.0, np.nan], "blue").spec() == {
        "t": "line",
        "x": [0.0, 1.0],
        "y": [2.0, None],
        "c": "blue",
    }
    assert Line(Grid(0.0, 1.0, 2), [2.0, 3.0], "blue", "a", 2.0, "3 4", fit=False).spec() == {
        "t": "line", "x": {"from": 0.0, "step": 1.0, "count": 2}, "y": [2.0, 3.0], "c": "blue", "name": "a", "w": 2.0,
        "d": "3 4", "fit": False,
    }  # fmt: skip
