"""The files of a fleet."""

from __future__ import annotations

import os
import resource

import pytest

from scara_ident.errors import ScaraIdentError
from scara_ident.fleet.table import fleet_table
from scara_ident.report.fleet import write_fleet
from tests.report.html.test_fleet import made_fleet


def test_a_file_that_would_be_the_same_is_left_alone(tmp_path):
    fleet = made_fleet()
    table = fleet_table(fleet)
    write_fleet(tmp_path, fleet, table)
    for name in ("fleet.parquet", "report.html"):
        os.utime(tmp_path / name, (0, 0))
    write_fleet(tmp_path, fleet, table)
    assert {path.name: path.stat().st_mtime for path in tmp_path.iterdir()} == {"fleet.parquet": 0, "report.html": 0}
    write_fleet(tmp_path, fleet, table.head(1))
    assert (tmp_path / "fleet.parquet").stat().st_mtime > 0 and (tmp_path / "report.html").stat().st_mtime == 0


def test_a_table_that_does_not_fit_leaves_the_earlier_files_and_one_line(tmp_path):
    fleet = made_fleet()
    (tmp_path / "fleet.parquet").write_text("earlier")
    usual = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, usual[1]))
    try:
        with pytest.raises(ScaraIdentError, match="give another folder") as caught:
            write_fleet(tmp_path, fleet, fleet_table(fleet))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, usual)
    assert str(tmp_path) in str(caught.value) and "\n" not in str(caught.value)
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("fleet.parquet", "earlier")]
