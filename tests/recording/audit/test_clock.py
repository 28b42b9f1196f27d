"""Missing numbers and the clock."""

from __future__ import annotations

import numpy as np
import pytest

from tests.made_recordings import columns
from tests.recording.audit.made import kinds, only, refusal


def rows(made: dict[str, np.ndarray], index: np.ndarray) -> dict[str, np.ndarray]:
    return {name: values[index] for name, values in made.items()}


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("column", ["time", "joint1.position", "joint2.effort"])
def test_scattered_rows_without_a_number_are_left_out_and_said(read, column, wrong):
    made = columns()
    made[column][[99, 500, 501, 3000]] = wrong
    recording = read(made)
    finding = only(recording, "nan")
    assert finding.count == 4
    assert f"{column} is empty, NaN or infinite in 4 of 4000 rows, first in row 100" in finding.message
    np.testing.assert_array_equal(recording.effort[0], np.delete(made["joint1.effort"], [99, 500, 501, 3000]))


def test_infinities_of_both_signs_do_not_hide_each_other(read):
    made = columns()
    made["joint1.effort"][10], made["joint1.effort"][20] = np.inf, -np.inf
    assert only(read(made), "nan").count == 2


def test_many_missing_numbers_are_refused_by_column_count_and_row(read):
    made = columns()
    made["joint2.position"][1000::30] = np.nan
    message = refusal(read, made)
    assert "joint2.position" in message
    assert "100 of 4000" in message
    assert "first in row 1001" in message


def test_a_run_of_missing_numbers_is_refused_inside_and_cut_off_at_the_ends(read):
    made = columns()
    made["joint1.effort"][2000:2015] = np.nan
    message = refusal(read, made)
    assert "15 rows in a row" in message
    assert "row 2001" in message
    made = columns()
    made["joint1.effort"][:20] = np.nan
    made["joint1.effort"][-15:] = np.nan
    recording = read(made)
    assert only(recording, "nan").count == 35
    assert len(recording.time) == 3965


def test_missing_numbers_of_an_optional_column_leave_that_column_out(read):
    made = columns()
    for joint in ("joint1", "joint2"):
        made[f"{joint}.velocity"] = np.gradient(made[f"{joint}.position"], 1e-3)
    made["joint2.velocity"][6] = np.nan
    recording = read(made)
    finding = only(recording, "nan")
    assert "joint2.velocity" in finding.message
    assert "row 7" in finding.message
    assert recording.velocity is None
    assert len(recording.time) == 4000


def test_an_optional_column_survives_where_its_missing_rows_are_left_out_anyway(read):
    made = columns()
    for joint in ("joint1", "joint2"):
        made[f"{joint}.velocity"] = np.gradient(made[f"{joint}.position"], 1e-3)
    made["joint2.velocity"][-1] = made["joint2.effort"][-1] = np.nan
    recording = read(made)
    assert kinds(recording) == ["nan"]
    np.testing.assert_array_equal(recording.velocity[1], made["joint2.velocity"][:-1])


@pytest.mark.parametrize("samples", [0, 1, 2, 49])
def test_too_few_samples_are_refused(read, samples):
    assert f"{samples} usable samples; at least 50" in refusal(read, columns(samples))


def test_fifty_samples_are_enough(read):
    assert len(read(columns(50, 0.05)).time) == 50


@pytest.mark.parametrize(
    ("factor", "interval", "looks"),
    [
        (1e3, 1e-3, "milliseconds"),
        (1e3, 1e-2, "milliseconds"),
        (1e6, 1e-3, "microseconds"),
        (1e6, 1.25e-4, "microseconds"),
        (1e9, 2e-3, "nanoseconds"),
        (1 / 3600, 1e-3, "write it in seconds"),
    ],
)
def test_time_in_another_unit_is_refused_with_the_unit_it_looks_like(read, factor, interval, looks):
    made = columns(interval=interval)
    made["time"] *= factor
    assert looks in refusal(read, made)


def test_time_that_runs_backwards_is_refused_by_row(read):
    made = columns()
    made["time"][2500:] -= 1.0
    message = refusal(read, made)
    assert "backwards at row 2501" in message
    assert "from 2.499 s to 1.5 s" in message
    assert "1 time in all" in message


def test_rows_in_no_order_are_refused_for_that_and_not_for_their_unit(read):
    """The steps forward of shuffled rows are so long that time was taken for milliseconds."""
    made = columns()
    for order in (np.random.default_rng(0).permutation(4000), np.arange(4000)[::-1]):
        message = refusal(read, rows(made, order))
        assert "time runs backwards at row" in message
        assert "sort the rows by time" in message


def test_rows_written_twice_are_dropped(read):
    made = columns()
    twice = rows(made, np.sort(np.concatenate([np.arange(4000), np.arange(4000)])))
    recording = read(twice)
    finding = only(recording, "repeated_time")
    assert finding.count == 4000
    assert "same values" in finding.message
    np.testing.assert_array_equal(recording.position[0], made["joint1.position"])


def test_of_differing_rows_of_one_time_the_first_is_kept(read):
    made = columns()
    made["time"][[7, 8, 300]] = made["time"][[6, 6, 299]]
    recording = read(made)
    finding = only(recording, "repeated_time")
    assert finding.count == 3
    assert "3 with other values" in finding.message
    assert "row 8" in finding.message
    np.testing.assert_array_equal(recording.effort[0], np.delete(made["joint1.effort"], [7, 8, 300]))


def test_a_clock_too_coarse_for_the_rate_is_refused(read):
    made = columns()
    made["time"] = np.floor(made["time"] / 3e-3) * 3e-3
    message = refusal(read, made)
    assert "clock is too coarse" in message
    assert "row 2 " in message


def test_time_that_never_advances_is_refused(read):
    made = columns()
    made["time"][:] = 5.0
    assert "never advances" in refusal(read, made)


def test_jitter_is_said_with_its_size(read):
    time = 1e-3 * (np.arange(4000) + np.random.default_rng(1).uniform(-0.2, 0.2, 4000))
    finding = only(read(columns(time=time)), "jitter")
    # The difference of two uniform deviates of half-width 0.2 has a standard deviation of 0.2 sqrt(2/3).
    assert "varies by 16 %" in finding.message
    assert finding.message.endswith("the time stamps are used")


@pytest.mark.parametrize(("digits", "rounded"), [(4, "0.1 ms"), (5, None)])
def test_stamps_that_are_rounded_are_said_to_be(read, digits, rounded):
    """The way of a joint within a stamp's last digit is noise of its positions."""
    time = 1.7e9 + 2e-3 * (np.arange(4000) + np.random.default_rng(1).uniform(-0.2, 0.2, 4000))
    said = only(read(columns(time=np.round(time, digits))), "jitter").message
    if rounded is None:
        assert said.endswith("are used")
    else:
        assert said.endswith(
            f"they are rounded to {rounded}, which is noise of the positions in motion: record time with more digits"
        )


def test_the_jitter_of_a_steady_clock_is_not_worth_a_line(read):
    made = columns()
    made["time"] += 1e-3 * np.random.default_rng(1).uniform(-0.02, 0.02, 4000)
    assert read(made).findings == ()


def test_lost_samples_and_gaps_are_counted_and_placed(read):
    made = columns()
    lost = np.concatenate([[100, 900, 1700, 1701], np.arange(2500, 2750)])
    recording = read(rows(made, np.delete(np.arange(4000), lost)))
    dropped, gap = recording.findings
    assert (dropped.kind, dropped.count) == ("dropped", 4)
    assert "row 101 (0.101 s)" in dropped.message
    assert (gap.kind, gap.count) == ("gap", 1)
    assert "0.251 s" in gap.message
    assert "(2.75 s)" in gap.message
    assert "about 250 samples" in gap.message
    assert len(recording.time) == 4000 - 254


def test_no_time_goes_by_in_copies_that_are_left_out(read):
    """A step of two intervals behind three copies was one of -1 ms."""
    made = columns()
    kept = np.delete(np.arange(4000), 2000)
    again = np.sort(np.concatenate([kept, [1999, 1999, 1999], np.arange(100, 3900, 25)]))
    copied = rows(made, again)
    # The log goes on at its rate while the source repeats itself.
    copied["time"] = copied["time"] + 1e-5 * np.concatenate([[0], np.cumsum(np.diff(copied["time"]) == 0)])
    found = read(copied).findings
    assert all("to -" not in item.message and ", -" not in item.message for item in found)
