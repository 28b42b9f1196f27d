"""``scara-ident fleet``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from scara_ident.cli import options
from scara_ident.cli.console import check_report, output_console, progress, table


def fleet(
    folder: Annotated[
        str,
        typer.Argument(
            metavar="FOLDER",
            help="Folder with a sub-folder for each arm, local or in an object store (s3://bucket/fleet); the names of files or "
            "of their folders hold the dates, such as 2026-03-01.",
        ),
    ],
    output: Annotated[
        Path, typer.Option("--output", metavar="DIR", help="Folder for the results; a later run continues from them.")
    ],
    robot: options.Robot = None,
    model: options.Model = "complete",
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler", metavar="ADDRESS", help="Dask scheduler, such as tcp://host:8786; default: this machine."
        ),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option(
            "--workers", metavar="N", min=1, help="Number of processes on this machine; default: one per core."
        ),
    ] = None,
) -> None:
    """Identify many arms on many dates, and say which arm changed, how, and since when."""
    from scara_ident.errors import ScaraIdentError
    from scara_ident.fleet import Settings, watch_fleet
    from scara_ident.fleet.table import fleet_table
    from scara_ident.manners import listed, several
    from scara_ident.report.html.fleet import write_fleet
    from scara_ident.robot.robot import load_robot

    check_report(output, "fleet")
    arm = load_robot(robot)
    with progress() as work:
        found = watch_fleet(folder, arm, output, Settings(model, scheduler, workers), work)
    console = output_console()
    counts = {
        kind: sum(item.verdict == kind for item in found.arms)
        for kind in ("changed", "unchanged", "undecided", "one date", "no data")
    }
    said = ", ".join(f"{count} {kind}" for kind, count in counts.items() if count)
    console.print(f"{len(found.arms)} arms of {arm.name}: {said}", style="bold")
    rows = table("arms, the most urgent first", "arm", "what changed, or is unlike other arms")
    for item in found.ranked:
        for k, words in enumerate((*item.sentences, *item.oddities)):
            rows.add_row("" if k else item.arm, words)
    if rows.row_count:
        console.print(rows)
    console.note([found.reservation] if found.reservation else [])
    console.note(found.notes)
    console.note(str(fault) for fault in found.faults)
    with progress() as work:
        work("drawing report.html")
        write_fleet(output, found, fleet_table(found))
    console.written(output, "fleet.parquet", "report.html")
    if found.faults:
        raise ScaraIdentError(
            f"{several(len(found.faults), 'fault')} in {folder}: {listed([str(fault) for fault in found.faults], 1)}; correct "
            "this and run again, all other results are kept"
        )
