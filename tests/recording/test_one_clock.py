"""Channels sampled apart come onto one clock, interpolated only where they have to be."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.recording.one_clock import on_one_clock, sparse_channel


def interleaved(*parts: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Rows of parts with clocks of their own, in the order of time; NaN where a row is another's."""
    time = np.concatenate([part["time"] for part in parts])
    order = np.argsort(time, kind="stable")
    found = {"time": time[order]}
    start = 0
    for part in parts:
        stop = start + len(part["time"])
        for name in part.keys() - {"time"}:
            values = np.full(len(time), np.nan)
            values[start:stop] = part[name]
            found[name] = values[order]
        start = stop
    return found


T = np.arange(200) / 100.0
ARM = {"time": T, "a": np.sin(T), "b": np.cos(T)}


def test_one_group_keeps_its_rows_and_a_number_that_lacks():
    lacking = ARM | {"a": np.where(np.arange(200) == 7, np.nan, ARM["a"])}
    found, said = on_one_clock(interleaved(lacking, {"time": T + 0.003, "other": T}), "time", ["a", "b"])
    assert said == ()
    np.testing.assert_array_equal(found["b"], ARM["b"])
    assert np.flatnonzero(np.isnan(found["a"])).tolist() == [7]


def test_the_same_stamps_are_joined_without_interpolating():
    found, (said,) = on_one_clock(interleaved(ARM, {"time": T, "c": T**2}), "time", ["a", "b", "c"])
    assert said.kind == "joined"
    np.testing.assert_array_equal(found["time"], T)
    np.testing.assert_array_equal(found["c"], T**2)


def test_other_stamps_are_interpolated_onto_the_clock_of_most_channels():
    other = T[:-1] + 0.004
    found, (said,) = on_one_clock(interleaved(ARM, {"time": other, "c": np.sin(3 * other)}), "time", ["a", "b", "c"])
    assert said.kind == "resampled"
    assert "c were sampled apart from a" in said.message
    # The first row lies before the other's first, the last beyond its last.
    np.testing.assert_array_equal(found["time"], T[1:-1])
    # Slopes of second-order differences err by h^2 / 6 of the third derivative, the cubic by a quarter of h times that.
    np.testing.assert_allclose(found["c"][1:-1], np.sin(3 * T[2:-2]), rtol=0, atol=27 * 0.01**3 / 24)


def test_nothing_is_interpolated_over_a_gap():
    other = np.delete(T + 0.004, np.arange(50, 90))
    found, (said,) = on_one_clock(interleaved(ARM, {"time": other, "c": other}), "time", ["a", "b", "c"])
    gap = np.diff(found["time"])
    assert gap.max() == pytest.approx(0.42, abs=0.011)
    assert "left out" in said.message


def test_a_channel_that_is_empty_stays_for_the_audit():
    found, _ = on_one_clock(ARM | {"c": np.full(200, np.nan)}, "time", ["a", "b", "c"])
    assert np.isnan(found["c"]).all()


def test_a_channel_that_may_lack_comes_along_where_its_rows_are_others():
    """Joints in messages of their own: the velocity of each stands in its own rows, as its position does."""
    other = T + 0.004
    first, second = ARM | {"va": np.cos(T)}, {"time": other, "c": np.sin(other), "d": T, "vc": np.cos(other)}
    found, (said,) = on_one_clock(interleaved(first, second), "time", ["a", "b", "c", "d"], ["va", "vc"])
    assert said.message.startswith("c, d, vc were sampled apart from a")
    assert np.isfinite(found["vc"]).all()
    np.testing.assert_allclose(found["vc"][1:-1], np.cos(found["time"])[1:-1], rtol=0, atol=0.01**3)


def test_a_gap_in_what_may_lack_costs_no_row():
    other = np.delete(T + 0.004, np.arange(50, 90))
    parts = interleaved(ARM | {"empty": np.full(200, np.nan)}, {"time": other, "v": other})
    found, (said,) = on_one_clock(parts, "time", ["a", "b"], ["v", "empty"])
    assert len(found["time"]) == 199
    assert said.kind == "resampled"
    assert np.count_nonzero(np.isnan(found["v"])) == 41
    assert np.isnan(found["empty"]).all()


def test_a_command_that_is_logged_when_it_changes_is_named():
    """6 usable samples were told of 18 000, and to record for longer."""
    few = {"time": T[::40], "c": np.ones(5)}
    made = interleaved(ARM, few)
    said = sparse_channel(made, ["a", "b", "c"])
    assert said is not None
    assert said.startswith("column 'c' has a number in 5 rows, others in 200; at least 50 are needed")
    assert sparse_channel(made, ["a", "b"]) is None
    # Too short a recording is one.
    short = {name: values[:30] for name, values in ARM.items()}
    assert sparse_channel(short | {"c": np.where(np.arange(30) < 5, 1.0, np.nan)}, ["a", "b", "c"]) is None
