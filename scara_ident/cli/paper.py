"""``scara-ident paper``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from scara_ident.cli import options
from scara_ident.cli.console import PlainConsole, check_report, output_console, table

if TYPE_CHECKING:
    from scara_ident.paper.report import PaperReport

# Printed line by line; of the others only the count and what differs.
_IN_FULL = ("Table 1", "Limits", "Torque rms from Table 5")


def paper(output: options.Output = None) -> None:
    """Compare the printed tables of the paper (Indri et al., 2002) with what the program computes."""
    from scara_ident.paper import check_paper

    check_report(output, "paper")
    report = check_paper()
    console = output_console()
    for section in report.sections:
        checks = report.section(section)
        agreeing = sum(check.agrees is True for check in checks)
        judged = sum(check.agrees is not None for check in checks)
        shown = checks if section in _IN_FULL else [check for check in checks if check.agrees is False]
        title = f"{section}: {agreeing} of {judged} agree"
        if not shown:
            console.print(title, style="italic")
            continue
        columns = ("quantity", "trajectory", "joint", "printed", "computed", "", "comment")
        rows = table(title, *columns, right=("printed", "computed"))
        for check in shown:
            mark = {True: "agrees", False: "differs", None: ""}[check.agrees]
            numbers = (_number(check.printed), _number(check.computed))
            rows.add_row(check.quantity, check.trajectory, check.joint, *numbers, mark, check.comment)
        console.print(rows)
    if output is not None:
        _write(output, report, console)


def paper_in_short(output: Path) -> None:
    """Count what agrees, section by section, and write ``paper.json`` with its report."""
    from scara_ident.paper import check_paper

    check_report(output, "paper")
    report = check_paper()
    rows = table("printed against computed", "of the paper", "agree", "judged", right=("agree", "judged"))
    for section in report.sections:
        judged = [check.agrees for check in report.section(section) if check.agrees is not None]
        rows.add_row(section, str(sum(judged)), str(len(judged)))
    console = output_console()
    console.print(rows)
    console.print("Every value, and why some differ: scara-ident paper")
    _write(output, report, console)


def _write(output: Path, report: PaperReport, console: PlainConsole) -> None:
    from scara_ident.files import write_json, written_together
    from scara_ident.report.html.paper import paper_report

    with written_together(output) as place:
        paper_report(place / "report.html", report)
        write_json(place / "paper.json", report.to_dict())
    console.written(output, "paper.json", "report.html")


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.4g}"
