"""The report of the paper's checks: every printed figure beside what is computed."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from scara_ident.paper.report import PaperReport
from scara_ident.report.html.blocks import Block, Cell, Paragraph, Table, Tag, name, number, superscripts
from scara_ident.report.html.page import Page, parts
from scara_ident.report.html.section import NamedSection

TAGS = {True: Tag("agrees", "good"), False: Tag("differs", "bad"), None: None}


def _checks(section: str, report: PaperReport) -> list[Block]:
    """The checks of one section of the paper."""
    checks = report.section(section)
    judged = [check.agrees for check in checks if check.agrees is not None]
    rows: list[list[Cell | str]] = [
        [
            name(check.quantity),
            check.trajectory,
            check.joint,
            number(check.printed, 4),
            number(check.computed, 4),
            "" if check.unit == "1" else superscripts(check.unit),
            Cell(check.condition, "unit"),
            Cell(tag=TAGS[check.agrees]),
            Cell(check.comment, "words"),
        ]
        for check in checks
    ]
    head = ("quantity", "trajectory", "joint", "printed", "computed", "unit", "condition", "", "comment")
    return [Paragraph(f"{sum(judged)} of {len(judged)} agree."), Table(head, rows, (3, 4))]


def paper_report(path: Path, report: PaperReport) -> None:
    """Write the report of the paper's checks as one HTML file.

    Raises
    ------
    ScaraIdentError
        If the file cannot be written.
    """
    sections = [
        NamedSection(f"checks-{k}", section, partial(_checks, section)) for k, section in enumerate(report.sections)
    ]
    judged = [check.agrees for check in report.checks if check.agrees is not None]
    verdict = (
        f"{sum(judged)} of {len(judged)} printed figures agree with what is computed.",
        "Differences are marked; comments say how a figure was computed.",
    )
    title, subtitle = (
        "The paper's tables, printed and computed",
        "Indri et al., Optimized dynamic calibration of a SCARA robot, IFAC 2002",
    )
    Page(title, subtitle, verdict, parts("paper", sections, report)).write(path)
