"""The median of real numbers."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.arrays import median, medians, runs_of


@pytest.mark.parametrize("count", [1, 2, 3, 10, 1001])
def test_the_median_is_that_of_numpy(count: int) -> None:
    values = np.random.default_rng(count).standard_normal(count)
    before = values.copy()
    assert median(values) == np.median(values)
    assert np.array_equal(values, before)
    rows = np.random.default_rng(count).standard_normal((2, 3, count))
    assert np.array_equal(medians(rows), np.median(rows, axis=-1))


def test_one_number_that_is_none_leaves_none() -> None:
    assert np.isnan(median(np.array([1.0, np.nan, 2.0, 0.0])))
    assert np.isnan(median(np.array([np.nan])))
    assert median(np.array([1.0, np.inf, 2.0])) == 2.0
    assert np.array_equal(medians(np.array([[1.0, np.nan], [1.0, 2.0]])), [np.nan, 1.5], equal_nan=True)


@pytest.mark.parametrize(
    ("flags", "wanted"),
    [
        ("", []),
        ("0", []),
        ("1", [(0, 1)]),
        ("0110100", [(1, 3), (4, 5)]),
        ("1001", [(0, 1), (3, 4)]),
        ("111", [(0, 3)]),
    ],
)
def test_runs_begin_at_their_first_flag_and_end_behind_their_last(flags: str, wanted: list[tuple[int, int]]) -> None:
    assert runs_of(np.array([flag == "1" for flag in flags], dtype=bool)) == wanted
