"""The files of a fleet: its table and its report, left alone where they would be the same."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING

from scara_ident.files import written_together
from scara_ident.fleet import Fleet
from scara_ident.report.html.fleet import fleet_report

if TYPE_CHECKING:
    import polars as pl

TABLE, REPORT = "fleet.parquet", "report.html"


def write_fleet(folder: Path, fleet: Fleet, table: pl.DataFrame) -> None:
    """Write the table and the report of a fleet; a file that is there with the same content stays as it is.

    Parameters
    ----------
    folder : Path
    fleet : Fleet
    table : DataFrame
        See `scara_ident.fleet.table.fleet_table`.

    Raises
    ------
    ScaraIdentError
        In one line, if they cannot be written.
    """
    content = BytesIO()
    table.write_parquet(content)
    with written_together(folder) as place:
        (place / TABLE).write_bytes(content.getvalue())
        fleet_report(place / REPORT, fleet)
        for name in (TABLE, REPORT):
            held = folder / name
            if held.is_file() and held.read_bytes() == (place / name).read_bytes():
                (place / name).unlink()
