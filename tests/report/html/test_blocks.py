"""Numbers as a page writes them."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scara_ident.report.html.blocks import Arm, chance, number, superscripts


@given(value=st.floats(-1e12, 1e12).filter(lambda x: x == 0.0 or abs(x) > 1e-12), digits=st.integers(1, 8))
def test_a_number_keeps_its_digits(value: float, digits: int):
    text = number(value, digits)
    assert abs(float(text) - value) <= 0.5000001 * 10.0 ** (1 - digits) * abs(value)
    assert not text.endswith(".")


@pytest.mark.parametrize(
    ("value", "text"), [(0.5, "0.500"), (None, "–"), (np.inf, "–"), (np.nan, "–"), (1234.0, "1.23e+03")]
)
def test_zeros_at_the_end_are_digits_and_what_is_no_number_is_a_dash(value: float | None, text: str):
    assert number(value) == text


@pytest.mark.parametrize(("p", "text"), [(0.0, "< 1e-99"), (3.14e-7, "3e-07"), (0.0314, "0.031"), (1.0, "1")])
def test_chances_are_reported_in_few_digits(p: float, text: str):
    assert chance(p) == text


def test_exponents_are_raised():
    assert superscripts("N m s^2/rad^3") == "N m s²/rad³"


def test_the_moving_arm_stays_within_the_limits_it_states():
    frames = np.random.default_rng(0).normal(size=(7, 3, 2))
    spec = Arm("arm", frames, 0.1).spec()
    drawn = np.array(spec["frames"]).reshape(7, spec["points"], 2)
    np.testing.assert_allclose(drawn, frames, atol=5.1e-5)
    assert np.all(drawn >= np.array(spec["low"]) - 1e-4)
    assert np.all(drawn <= np.array(spec["high"]) + 1e-4)
    np.testing.assert_array_equal(np.array(spec["low"]), frames.min(axis=(0, 1)))
