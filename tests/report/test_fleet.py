"""The files of a fleet."""

from __future__ import annotations

import os

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
