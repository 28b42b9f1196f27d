"""Columns of Parquet and CSV files, the dialects of CSV, and exports of other programs."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from scara_ident.errors import RecordingError
from scara_ident.recording.files.parquet_csv import read_columns
from scara_ident.recording.recording import (
    read_recording,
)
from tests.made_recordings import columns, save
from tests.recording.files.formats import (
    write_plotjuggler,
)
from tests.recording.files.made import MADE, PLOTJUGGLER, assert_same, described, expected, stacked
from tests.recording.made import csv_lines, refusal, write_text


def test_files_that_are_no_recordings_are_refused_in_a_line(robot, tmp_path):
    whole = save(tmp_path / "whole.parquet", columns()).read_bytes()
    made = {
        "empty.parquet": (b"", "empty"),
        "empty.csv": (b"", "empty"),
        "blank.csv": (b"\n\n", "no column 'time'"),
        "text.parquet": (b"this is no parquet file at all", "not a whole parquet file"),
        "cut.parquet": (whole[: len(whole) // 2], "not a whole parquet file"),
        "header.csv": (b"time,joint1.position,joint2.position,joint1.effort,joint2.effort\n", "0 usable samples"),
        "numbers.csv": (b"0.0,1.0,2.0,0.1,0.2\n0.1,1.0,2.0,0.1,0.2\n", "first line holds numbers"),
        "no_text.csv": (b"time,gr\x81\x9de\n0,1\n", "save the CSV again in UTF-8"),
        "picture.csv": (b"\x89PNG\r\n\x1a\n\0\0,1\n", "save the CSV again in UTF-8"),
        "half.csv": ("time,größe\n0,1\n".encode("utf-16")[:-1], "save the CSV again in UTF-8"),
        "log.xlsx": (b"PK", "suffix '.xlsx'"),
        "log": (b"PK", "suffix ''"),
        "log.txt": (b"time,q\n0,1\n", "rename it to log.csv, whatever separates"),
        "twice.csv": (b"time,joint1.position,joint1.position\n0,1,1\n", "'joint1.position' is in the header twice"),
    }
    for name, (content, said) in made.items():
        path = tmp_path / name
        path.write_bytes(content)
        assert said in refusal(path, robot), name
    assert "no such file" in refusal(tmp_path / "absent.parquet", robot)
    (tmp_path / "folder.parquet").mkdir()
    assert "is a directory" in refusal(tmp_path / "folder.parquet", robot)


@pytest.mark.parametrize(
    ("encoding", "said"),
    [("utf-8", ""), ("utf-8-sig", ""), ("utf-16", ""), ("cp1252", "the file is not in UTF-8: read as Windows-1252")],
)
def test_a_csv_is_read_in_the_encodings_of_windows_too(robot, tmp_path, encoding, said):
    rows = [line.replace(",", ";").replace(".", ",") for line in csv_lines()]
    rows = ["Säule \u2013 Prüfstand;5 €", rows[0].replace(",", ".") + ";Größe", *(f"{row};Stück" for row in rows[1:])]
    path = tmp_path / "log_1.csv"
    path.write_bytes("\r\n".join(rows).encode(encoding))
    found = read_recording(path, robot)
    assert "; ".join(finding.message for finding in found.findings) == said
    whole = read_recording(save(tmp_path / "whole.parquet", columns(200)), robot)
    np.testing.assert_array_equal(found.position, whole.position)
    rows[5] = rows[5].replace(";", ";Größe;", 1)
    path.write_bytes("\r\n".join(rows).encode(encoding))
    assert "row 4 has 7 values for 6 columns" in refusal(path, robot)


def test_damage_anywhere_in_a_parquet_file_never_ends_in_another_exception(robot, tmp_path):
    whole = save(tmp_path / "whole.parquet", columns(300)).read_bytes()
    random = np.random.default_rng(0)
    path = tmp_path / "damaged.parquet"
    refused = 0
    for start in random.integers(4, len(whole) - 8, 40).tolist():
        damaged = bytearray(whole)
        damaged[start : start + 8] = random.bytes(8)
        path.write_bytes(damaged)
        try:
            read_recording(path, robot)
        except RecordingError as error:
            refused += 1
            assert "\n" not in str(error)
    assert refused > 0


def test_a_file_without_permission_is_refused(robot, tmp_path, monkeypatch):
    path = save(tmp_path / "a.parquet", columns())

    def denied(*_args: object, **_options: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", denied)
    assert "permission denied" in refusal(path, robot)


def test_dates_in_a_parquet_file_are_read_and_texts_refused(robot, tmp_path):
    frame = pl.DataFrame(columns())
    path = tmp_path / "a.parquet"
    frame.with_columns((pl.col("time") * 1e6 + 1.7e15).cast(pl.Datetime("us"))).write_parquet(path)
    np.testing.assert_allclose(read_recording(path, robot).time, columns()["time"], rtol=0, atol=2e-6)
    frame.with_columns((pl.col("time") > 1).alias("time")).write_parquet(path)
    assert "'time' holds Boolean; it must hold time in seconds" in refusal(path, robot)
    frame.with_columns(
        pl.when(pl.int_range(pl.len()) == 41)
        .then(pl.lit("off"))
        .otherwise(pl.col("joint1.effort").cast(pl.String))
        .alias("joint1.effort")
    ).write_parquet(path)
    assert "'joint1.effort', row 42: 'off' is not a number" in refusal(path, robot)


@pytest.mark.parametrize(
    ("change", "end", "encoding"),
    [
        (lambda line: line, "\n", "utf-8"),
        (lambda line: line, "\r\n", "utf-8-sig"),
        (lambda line: line.replace(",", ", "), "\n", "utf-8"),
        (lambda line: line.replace(",", "\t"), "\n", "utf-8"),
        (lambda line: line.replace(",", ";"), "\n", "utf-8"),
        (lambda line: ",".join(f'"{word}"' for word in line.split(",")), "\n", "utf-8"),
    ],
)
def test_the_dialects_of_csv_read_alike(robot, tmp_path, change, end, encoding):
    path = write_text(tmp_path / "a.csv", [change(line) for line in csv_lines()], end, encoding)
    recording = read_recording(path, robot)
    made = columns(200)
    np.testing.assert_array_equal(recording.time, made["time"])
    np.testing.assert_array_equal(recording.effort[1], made["joint2.effort"])
    assert recording.findings == ()


def test_a_decimal_comma_is_read_behind_semicolons(robot, tmp_path):
    head, *body = csv_lines()
    lines = [head.replace(",", ";"), *(line.replace(",", ";").replace(".", ",") for line in body)]
    recording = read_recording(write_text(tmp_path / "a.csv", lines), robot)
    np.testing.assert_array_equal(recording.position[0], columns(200)["joint1.position"])


def test_a_text_in_a_number_column_is_refused_by_row_and_value(robot, tmp_path):
    lines = csv_lines()
    lines[31] = "0.030,oops,0.1,0.1,0.1"
    lines[40] = "0.039,oops,0.1,0.1,0.1"
    message = refusal(write_text(tmp_path / "a.csv", lines), robot)
    assert "column 'joint1.position', row 31: 'oops' is not a number (and 1 more)" in message


def test_a_date_that_does_not_exist_is_refused_by_its_own_row(robot, tmp_path):
    """The first row was said to be no number, of a column of dates."""
    head, *body = csv_lines()
    lines = [head, *(f"2026-02-28 10:00:0{line}" for line in body)]
    assert read_recording(write_text(tmp_path / "a.csv", lines), robot).findings == ()
    lines[41] = lines[41].replace("02-28", "02-30")
    message = refusal(write_text(tmp_path / "b.csv", lines), robot)
    assert "row 41: '2026-02-30 10:00:00.040" in message and "is no point in time, unlike most rows" in message


def test_a_text_in_a_column_that_is_not_needed_is_no_matter(robot, tmp_path):
    lines = csv_lines()
    lines = [f"{lines[0]},note", *(f"{line},running" for line in lines[1:])]
    assert read_recording(write_text(tmp_path / "a.csv", lines), robot).findings == ()


def test_empty_values_and_words_for_them_count_as_missing(robot, tmp_path):
    lines = csv_lines()
    lines[11] = lines[11].rpartition(",")[0] + ","
    lines[21] = lines[21].rpartition(",")[0] + ",NA"
    lines[31] = lines[31].rpartition(",")[0] + ",nan"
    recording = read_recording(write_text(tmp_path / "a.csv", lines), robot)
    assert [(finding.kind, finding.count) for finding in recording.findings] == [("nan", 3)]
    assert "joint2.effort" in recording.findings[0].message
    assert "first in row 11" in recording.findings[0].message


def test_a_last_line_cut_short_is_left_out_and_a_line_too_long_refused(robot, tmp_path):
    lines = csv_lines()
    path = tmp_path / "a.csv"
    path.write_text("\n".join(lines) + "\n0.2,1.5")
    recording = read_recording(path, robot)
    assert len(recording.time) == 200
    assert "row 201" in recording.findings[0].message
    lines[50] += ",1.0"
    assert "row 50 has 6 values for 5 columns" in refusal(write_text(path, lines), robot)


def test_rows_of_other_signals_in_plotjugglers_csv_are_none_of_the_arms(tmp_path):
    path = write_plotjuggler(tmp_path / "log.csv", MADE)
    found = read_recording(path, described(tmp_path, PLOTJUGGLER))
    assert found.findings == ()
    # A double of 1.7e9 s has steps of 0.24 us.
    assert_same(found, expected(tmp_path), clock=5e-7)


def test_a_value_that_lacks_in_a_row_of_the_arm_is_found_by_its_row_among_the_arms(tmp_path):
    path = write_plotjuggler(tmp_path / "log.csv", MADE)
    lines = path.read_text().splitlines()
    cells = lines[3].split(",")
    assert cells[1]
    lines[3] = ",".join([cells[0], "", *cells[2:]])  # the second of the arm's, behind one of another signal
    path.write_text("\n".join(lines) + "\n")
    (finding,) = read_recording(path, described(tmp_path, PLOTJUGGLER)).findings
    assert finding.kind == "nan"
    assert "row 2" in finding.message


def test_blanks_separate_where_nothing_else_does(tmp_path):
    names = ["timestamp", "actual_q_0", "actual_q_1", "actual_current_0", "actual_current_1"]
    table = [MADE["time"], *stacked("position"), *stacked("effort", 0.5)]
    lines = [" ".join(names), *(" ".join(f"{v:.17g}" for v in row) for row in zip(*table, strict=True))]
    (tmp_path / "rtde.csv").write_text("\n".join(lines) + "\n")
    robot = described(
        tmp_path,
        "{time: {column: timestamp}, position: {column: 'actual_q_{index}'}, "
        "effort: {column: 'actual_current_{index}', unit: A}}",
        "{joint1: {effort_gain: 2}, joint2: {effort_gain: 2}}",
    )
    found = read_recording(tmp_path / "rtde.csv", robot)
    np.testing.assert_allclose(found.effort, stacked("effort"), rtol=1e-12)
    np.testing.assert_array_equal(found.position, stacked("position"))


def test_what_the_reader_prints_of_a_damaged_file_does_not_reach_the_user(tmp_path, capfd, monkeypatch):
    path = tmp_path / "run.parquet"
    pl.DataFrame({"time": [0.0, 0.1]}).write_parquet(path)

    def panics(*_, **__):
        os.write(2, b"thread 'async-executor-0' panicked\nstack backtrace:\n")
        raise pl.exceptions.PanicException("assertion failed")

    monkeypatch.setattr(pl, "read_parquet", panics)
    with pytest.raises(RecordingError, match="not a whole parquet file"):
        read_columns(path, ["time"])
    assert capfd.readouterr().err == ""
