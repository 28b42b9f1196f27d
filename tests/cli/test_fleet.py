"""The command: this machine's processes, its files, its exit status."""

from __future__ import annotations

from pathlib import Path

import polars as pl
import pytest

from tests.fleet.made import write_fleet

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return write_fleet(tmp_path_factory.mktemp("fleet"), arms=2, dates=2)


def test_a_fleet_is_watched_on_this_machine_and_faults_are_status_1(command, folder, tmp_path):
    done = command("fleet", folder, "--output", tmp_path, "--workers", "1")
    assert done.status == 0
    # Of two differences neither is told from what differs by nature.
    assert "2 arms of scara03: 2 undecided" in done.out
    assert "note: 2 differences between dates of the whole fleet are too few to distinguish a change" in " ".join(
        done.out.split()
    )
    table = pl.read_parquet(tmp_path / "fleet.parquet")
    assert {"arm", "date", "quantity", "parameter", "std", "effect", "error", "verdict", "fault"} <= set(table.columns)
    assert table.schema["date"] == pl.Date and len(table.unique(["arm", "date"])) == 4
    before = {path: path.stat().st_mtime_ns for path in tmp_path.rglob("*")}
    (folder / "arm2" / "2026-03-15_1.csv").write_text("no recording")
    again = command("fleet", folder, "--output", tmp_path, "--workers", "1")
    assert again.status == 1
    assert "1 fault" in again.err and "arm2/2026-03-15_1.csv" in again.err
    kept = {path: time for path, time in before.items() if path.suffix == ".npz"}
    assert kept == {path: path.stat().st_mtime_ns for path in kept} and len(kept) == 4
    table = pl.read_parquet(tmp_path / "fleet.parquet")
    assert table["fault"].drop_nulls().len() == 1 and len(table.unique(["arm", "date"])) == 5


@pytest.mark.parametrize(
    ("words", "said"),
    [(["fleet", "{}/none"], "no such folder"), (["fleet", "{}/arm1/2026-01-15"], "one for each arm")],
)
def test_a_folder_that_is_no_fleet_is_refused(command, folder, tmp_path, words, said):
    done = command(*(word.format(folder) for word in words), "--output", tmp_path)
    assert done.status in (1, 2) and said in done.err
