"""Points in time in the ways that people write them."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from scara_ident.recording.files.dates import first_wrong, is_date, seconds


@pytest.mark.parametrize(
    "words",
    [
        ["2023-11-20 10:33:21.1", "2023-11-20 10:33:21.35", "2023-11-20 10:33:22"],
        ["2023-11-20T10:33:21.1Z", "2023-11-20T10:33:21.35Z", "2023-11-20T10:33:22.0Z"],
        ["2023-11-20T10:33:21.1+01:00", "2023-11-20T11:33:21.35+02:00", "2023-11-20T10:33:22+0100"],
        ["20.11.2023 10:33:21,1", "20.11.2023 10:33:21,35", "20.11.2023 10:33:22,0"],
        ["20/11/2023 10:33:21.1", "20/11/2023 10:33:21.35", "20/11/2023 10:33:22"],
        ["11/20/2023 10:33:21.1 AM", "11/20/2023 10:33:21.35 AM", "11/20/2023 10:33:22.0 AM"],
        ["10:33:21.1", "10:33:21.35", "10:33:22"],
        ["23:59:59.5", "23:59:59.75", "00:00:00.4"],
    ],
)
def test_seconds_since_the_first(words: list[str]):
    found = seconds(pl.Series([*words, ""]))
    assert found is not None
    np.testing.assert_allclose(found, [0.0, 0.25, 0.9, np.nan], rtol=0, atol=1e-12)


def test_times_of_other_types_keep_their_nanoseconds():
    stamps = pl.Series([0, 250_000_001, 900_000_000])
    for kind in (pl.Datetime("ns"), pl.Duration("ns"), pl.Time):
        np.testing.assert_array_equal(seconds(stamps.cast(kind)), [0.0, 0.250000001, 0.9])


@pytest.mark.parametrize("words", [["running", "10:33:21"], ["1.5", "2.5"], [""], ["2023-11-20 10:33:21", "10:33:22"]])
def test_other_words_are_no_times(words: list[str]):
    assert seconds(pl.Series(words)) is None


def test_the_row_whose_date_does_not_exist_is_found():
    words = [f"2026-02-{day:02} 10:00:00.5" for day in (26, 27, 28, 29, 28)]
    assert seconds(pl.Series(words)) is None and first_wrong(pl.Series(words)) == 3
    assert first_wrong(pl.Series(["", None, *words])) == 5
    assert first_wrong(pl.Series(["oops", "1.5", "2.5"])) is None


def test_a_header_is_no_date():
    assert is_date("2023-11-20 10:33:21.1")
    assert not is_date("time")
