"""Where the table of a CSV file stands, told by its rows."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scara_ident.errors import RecordingError
from scara_ident.recording.files.csv_layout import LONGEST_LINE, csv_layout
from scara_ident.recording.files.parquet_csv import read_columns

HEAD, ROWS = "time,q,tau", ["0.0,1.5,2", "0.1,1.25,-3e-1", "0.2,1.0,4"]


@pytest.mark.parametrize("encoding", ["utf-8-sig", "cp1252", "utf-16"])
def test_the_encoding_is_the_first_in_which_the_lines_are_text(tmp_path, encoding):
    path = tmp_path / "log.csv"
    path.write_bytes("\n".join(["time,größe,°", *ROWS]).encode(encoding))
    found = csv_layout(path)
    assert (found.encoding, found.names) == (encoding, ("time", "größe", "°"))


@pytest.mark.parametrize(
    ("before", "names", "first"),
    [
        ([HEAD], ("time", "q", "tau"), 1),
        ([], ("column_1", "column_2", "column_3"), 0),
        (["a log", "", HEAD], ("time", "q", "tau"), 3),
        (["a log,of,three words", HEAD], ("time", "q", "tau"), 2),
        (["Samples,3", "Rate,10", HEAD], ("time", "q", "tau"), 3),
        (["a log"], ("column_1", "column_2", "column_3"), 1),
        ([f"# {HEAD}"], ("time", "q", "tau"), 1),
        (["#,q,tau"], ("#", "q", "tau"), 1),
        ([HEAD, "s,rad,Nm"], ("time", "q", "tau"), 2),
        ([HEAD, "ms,deg,A"], ("time [ms]", "q [deg]", "tau [A]"), 2),
        ([HEAD, "[ms],-,"], ("time [ms]", "q", "tau"), 2),
        (["time,1,2"], ("time", "1", "2"), 1),
        ([HEAD, "0,oops,1"], ("time", "q", "tau"), 1),
        ([HEAD, "0,1,2,3"], ("time", "q", "tau"), 1),
    ],
)
def test_the_rows_tell_what_stands_before_them(tmp_path, before, names, first):
    path = tmp_path / "log.csv"
    path.write_text("\n".join([*before, *ROWS]) + "\n")
    found = csv_layout(path)
    assert (found.separator, found.decimal_comma, found.names, found.first) == (",", False, names, first)


@pytest.mark.parametrize(
    "write",
    [
        lambda row: " ".join(row) + " ",
        lambda row: " " + " ".join(row),
        lambda row: "".join(f"{word:>12}" for word in row),
        lambda row: "".join(f"{word:<12}" for word in row),
        lambda row: ", ".join(row) + ",",
        lambda row: ",".join(row) + ", ,",
        lambda row: "".join(f"{word}\t" for word in row),
        lambda row: "".join(f"{word};" for word in row),
    ],
)
@pytest.mark.parametrize("end", ["\n", "\r\n"])
@pytest.mark.parametrize("head", [None, "also", "plain"])
def test_separators_at_the_ends_of_a_line_and_several_blanks_are_no_columns(tmp_path, write, end, head):
    rows = [line.split(",") for line in ROWS]
    names = HEAD.split(",")
    separator = next((mark for mark in ",\t;" if mark in write(names)), " ")
    first = {None: [], "also": [write(names)], "plain": [separator.join(names)]}[head]
    path = tmp_path / "log.csv"
    path.write_bytes(end.join([*first, *map(write, rows), ""]).encode())
    names = names if head else ["column_1", "column_2", "column_3"]
    assert csv_layout(path).names == tuple(names)
    found = read_columns(path, names)
    np.testing.assert_array_equal(np.array([found[name] for name in names]).T, np.array(rows, float))


def test_rows_with_gaps_need_no_header_and_columns_without_a_name_are_called_by_their_place(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["0.0,,2", *ROWS]))
    assert csv_layout(path).names == ("column_1", "column_2", "column_3")
    np.testing.assert_array_equal(read_columns(path, ["column_2"])["column_2"], [np.nan, 1.5, 1.25, 1.0])
    # A spreadsheet saves what it has beside the table too, and a data frame the number of the row.
    path.write_text("\n".join([f",{HEAD},,", *(f"{k},{row},," for k, row in enumerate(ROWS))]))
    assert csv_layout(path).names == ("column_1", "time", "q", "tau")
    path.write_text("\n".join([f"{HEAD},,", *(f"{row},,{k}" for k, row in enumerate(ROWS))]))
    assert csv_layout(path).names == ("time", "q", "tau", "column_4", "column_5")
    np.testing.assert_array_equal(read_columns(path, ["column_5"])["column_5"], [0.0, 1.0, 2.0])
    # Of a signal that begins later there are no numbers at first, but a name.
    path.write_text("\n".join([f"{HEAD},late", *(f"{row}," for row in ROWS), "0.3,1,2,7"]))
    np.testing.assert_array_equal(read_columns(path, ["late"])["late"], [np.nan, np.nan, np.nan, 7.0])


def test_a_line_too_long_is_found_behind_several_blanks_too(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("\n".join(["  time  q", *(f"   {k}   0.5 " for k in range(9)), "  9  0.5  1.0 "]))
    with pytest.raises(RecordingError, match="row 10 has 3 values for 2 columns"):
        read_columns(path, ["time", "q"])


def test_a_line_of_units_in_brackets_keeps_one_pair_of_them(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("\n".join([HEAD, "(ms),(deg),(Nm)", *ROWS]))
    assert csv_layout(path).names == ("time [ms]", "q [deg]", "tau")


def test_what_is_no_table_has_a_layout_too(tmp_path):
    path = tmp_path / "log.csv"
    for text, names in (
        ("", ()),
        ("\n\n", ()),
        ("just words", ("just", "words")),
        (HEAD, ("time", "q", "tau")),
        ("word", ("word",)),
    ):
        path.write_text(text)
        assert csv_layout(path).names == names
    path.write_text(f"{HEAD}\n" + "0" * LONGEST_LINE)
    assert csv_layout(path).names == ("time", "q", "tau")
    path.write_text("x" * LONGEST_LINE)
    with pytest.raises(RecordingError, match="not a table"):
        csv_layout(path)


@pytest.mark.slow
@given(
    separator=st.sampled_from([";", "\t", ",", " "]),
    before=st.lists(st.sampled_from(["", "a log", "Samples;3", "Rate\t10", "# remark, of two parts"]), max_size=4),
    values=st.lists(st.lists(st.floats(-1e9, 1e9, width=32), min_size=3, max_size=3), min_size=2, max_size=6),
    units=st.booleans(),
)
def test_whatever_stands_before_it_a_table_reads_as_it_was_written(tmp_path_factory, separator, before, values, units):
    path = tmp_path_factory.mktemp("csv") / "log.csv"
    names = ["t", "q", "tau"]
    lines = [*before, separator.join(names), *([separator.join(["s", "rad", "N"])] if units else [])]
    comma = separator in ";\t"
    rows = [
        separator.join(f"{value!r}".replace(".", ",") if comma else f"{value!r}" for value in row) for row in values
    ]
    path.write_text("\n".join([*lines, *rows]) + "\n")
    found = read_columns(path, names)
    np.testing.assert_array_equal(np.array([found[name] for name in names]).T, values)
