"""What a terminal, a pipe and a script are given."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from scara_ident.cli.console import output_console, progress, table
from scara_ident.report.summaries.words import number
from tests.made_recordings import columns, save
from tests.shared import PATIENCE


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "file", "key"),
    [
        (["identify", "{runs}/OJD_1.parquet", "--band", "15"], "identification.json", "parameters"),
        (["diagnose", "{short}", "--model", "basic"], "diagnosis.json", "verdict"),
        (["compare", "{runs}"], "comparison.json", "errors"),
        (["base"], "base.json", "base_parameters"),
    ],
    ids=lambda words: words[0] if isinstance(words, list) else "",
)
def test_json_on_stdout_is_all_there_is_and_what_is_in_the_file(
    command, folder: Path, tmp_path: Path, words: list[str], file: str, key: str
):
    short = save(tmp_path / "short_1.parquet", columns(1500))
    given = [word.replace("{runs}", str(folder)).replace("{short}", str(short)) for word in words]
    out = tmp_path / "results"
    result = command(*given, "--json", "--output", out)
    assert result.status == 0
    content = json.loads(result.out)
    assert key in content
    assert content == json.loads((out / file).read_text())


@pytest.mark.slow
@pytest.mark.parametrize("form", [[], ["--json"]], ids=["tables", "json"])
def test_results_are_written_though_nobody_reads_the_output(tmp_path: Path, form: list[str]):
    program = [sys.executable, "-c", "from scara_ident.cli import main; main()"]
    reader, writer = os.pipe()
    os.close(reader)
    done = subprocess.run(
        [*program, "base", "--output", str(tmp_path), *form],
        stdout=writer, stderr=subprocess.PIPE, text=True, timeout=PATIENCE, check=False,
    )  # fmt: skip
    os.close(writer)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads((tmp_path / "base.json").read_text())["count"] == 5


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ["identify", "{runs}", "--verbose"],
        ["diagnose", "{short}", "--verbose"],
        ["compare", "{runs}", "--verbose"],
        ["base"],
        ["paper"],
    ],
    ids=lambda words: words[0],
)
def test_tables_fit_80_columns(command, folder: Path, tmp_path: Path, words: list[str]):
    short = save(tmp_path / "short_1.parquet", columns(1500))
    result = command(*(word.replace("{runs}", str(folder)).replace("{short}", str(short)) for word in words))
    assert result.status == 0
    assert max(len(line) for line in result.out.splitlines()) <= 80


@pytest.mark.slow
def test_verbose_lists_what_every_file_holds(command, folder: Path, tmp_path: Path):
    made = columns(3000)
    gap = save(tmp_path / "gap_1.parquet", {name: values[made["time"] != 1.0] for name, values in made.items()})
    terse = command("identify", folder / "OJD_1.parquet", gap, "--band", "15")
    verbose = command("identify", folder / "OJD_1.parquet", gap, "--band", "15", "--verbose")
    assert (terse.status, verbose.status) == (0, 0)
    assert terse.out in verbose.out
    listing = verbose.out.removesuffix(terse.out)
    # Found of the first: positions that no encoder gives.
    assert "OJD_1: positions have neither noise nor an encoder's steps" in " ".join(listing.split())
    assert ["OJD_1", "3000", "12", "250", "1"] in [line.split() for line in listing.splitlines()]
    assert ["gap_1", "2999", "2.999", "1000"] in [line.split()[:4] for line in listing.splitlines()]


@given(value=st.floats(-1e6, 1e6), std=st.floats(1e-8, 1e5))
@example(value=0.0, std=9.99)
def test_a_number_is_written_to_a_tenth_of_its_standard_deviation(value: float, std: float):
    text = number(value, std)
    assert abs(float(text) - value) <= 0.0501 * std
    # Another digit would be noise.
    places = len(text.partition(".")[2])
    assert places == 0 or 10.0**-places > 0.0099 * std


@pytest.mark.parametrize(
    ("value", "std", "text"), [(1.23456, None, "1.235"), (1.23456, 0.0, "1.235"), (12345678.0, 3.0, "1.235e+07")]
)
def test_without_a_standard_deviation_four_digits_are_written(value: float, std: float | None, text: str):
    assert number(value, std) == text


def test_names_are_printed_as_they_are_and_numbers_stand_below_each_other(capsys: pytest.CaptureFixture[str]):
    rows = table("title", "name", "value", right=("value",))
    rows.add_row("[bold]run[/bold]", "1.5")
    rows.add_row("b", "12.5")
    output_console().print(rows)
    lines = capsys.readouterr().out.splitlines()
    assert lines[2].startswith("[bold]run[/bold]")
    assert len(lines[2].rstrip()) == len(lines[3].rstrip())


def test_nothing_of_the_progress_reaches_a_pipe(capfd: pytest.CaptureFixture[str]):
    with progress() as work:
        work("reading")
        work.part(0.5, 1.0)("estimating", 0.5)
    assert capfd.readouterr() == ("", "")
