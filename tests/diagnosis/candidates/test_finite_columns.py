"""Columns that are finite, against values that are not, and slopes against the derivative."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from scara_ident.diagnosis.candidates.finite_columns import MAX_COLUMN, finite_or_zero, is_finite, torque_slope

PLAIN = np.array([[1.0, -2.0, 3.0], [0.0, 0.0, 0.0]])


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf, 2.0 * MAX_COLUMN, -1e200])
def test_one_value_that_no_fit_can_take_is_enough(value: float):
    columns = PLAIN.copy()
    assert is_finite(columns)
    columns[1, 2] = value
    assert not is_finite(columns)
    assert_array_equal(finite_or_zero(columns), [PLAIN[0], [0.0, 0.0, 0.0]])


def test_what_is_finite_stays_what_it_is_and_nothing_is_finite():
    assert finite_or_zero(PLAIN) is PLAIN
    assert is_finite(np.zeros((2, 0)))


def test_products_of_the_largest_and_their_squares_are_finite():
    largest = np.full(10_000, MAX_COLUMN)
    assert np.isfinite((largest @ largest) ** 2)


def test_a_slope_is_that_between_the_sides_and_beside_one_that_has_no_columns_that_to_the_other():
    t = np.linspace(0.0, 1.0, 50)
    value, reach = np.array([2.0]), 1e-3

    def columns(rate: float) -> dict[int, np.ndarray]:
        return {1: np.exp(rate * t)[None]}

    middle, up, down, none = columns(1.0), columns(1.0 + reach), columns(1.0 - reach), {1: np.zeros((1, 50))}
    exact = 2.0 * t * np.exp(t)
    # Of second order in the reach between the sides, of first order beside one.
    assert_allclose(torque_slope(value, middle, [up, down], reach)[1], exact, atol=reach**2)
    for sides in ([up, none], [none, down]):
        assert_allclose(torque_slope(value, middle, sides, reach)[1], exact, atol=2.0 * np.e * reach)
    assert_array_equal(torque_slope(value, middle, [none, none], reach)[1], 0.0)
