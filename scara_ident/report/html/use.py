"""The report of a model in use."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident.manners import several
from scara_ident.report.html.blocks import Block, Cell, Group, Paragraph, Table, name, number, superscripts
from scara_ident.report.html.page import Page, parts
from scara_ident.report.html.section import NamedSection, Section
from scara_ident.report.plot import Dots, Grid, Layer, Line, Panel, Plot, single, style
from scara_ident.report.use import WORDS, use_dict
from scara_ident.use import Use


@dataclass(frozen=True, eq=False)
class UseContext:
    """What the sections draw from."""

    result: Use
    content: Mapping[str, Any]

    @property
    def joints(self) -> Sequence[str]:
        """Names of the joints."""
        return self.result.model.robot.joints


def _tracking(context: UseContext) -> list[Block]:
    """The error with every feed-forward, as a table and over time."""
    result, units = context.result, context.content["units"]
    alone = context.content["tracking"]["pid"]
    rows: list[list[Cell | str]] = []
    for key, errors in context.content["tracking"].items():
        cells = [
            Cell(number(errors[joint]), "num", track=min(1.0, errors[joint] / alone[joint]) if alone[joint] else None)
            for joint in context.joints
        ]
        rows.append([name(WORDS[key]), *cells])
    head = ["rms tracking error", *(f"{joint} [{superscripts(units[joint])}]" for joint in context.joints)]
    words = (
        f"{several(len(result.runs), 'virtual arm')} with parameters drawn at random from the identified values and "
        f"their standard deviations follow a motion of {result.motion.duration:.3g} s that was not used in the "
        f"identification. Bars: rms tracking error as a share of that with the PID alone."
    )
    figures = []
    for j, joint in enumerate(context.joints):
        lines = []
        for k, item in enumerate(result.runs[0]):
            color, dash = style(k)
            lines.append(
                Line(Grid(0.0, float(item.time[1]), len(item.time)), item.error[j], color, WORDS[item.name], 1.3, dash)
            )
        panel = Panel(f"tracking error [{superscripts(units[joint])}]", lines, 220)
        figures.append(single(f"tracking-{j}", f"{joint}, first arm", "", Plot("time [s]", (panel,))))
    return [Paragraph(words), Table(head, rows, range(1, len(head))), Group("tracking-group", figures)]


def _rollouts(context: UseContext) -> list[Block]:
    """How far a simulation drifts from the recordings."""
    result, units = context.result, context.content["units"]
    if not result.rollouts:
        return []
    rows: list[list[Cell | str]] = []
    for key, errors in context.content["rollout"].items():
        for horizon, row in errors.items():
            rows.append([name(WORDS[key]), f"{horizon} s", *(number(row[joint]) for joint in context.joints)])
    head = ["simulated", "after", *(f"{joint} [{superscripts(units[joint])}]" for joint in context.joints)]
    words = "The simulated arm starts from many states of the recordings and moves with the recorded torque alone; shown is its rms distance from the recorded position."
    finite = np.isfinite(next(iter(result.rollouts.values()))).all(axis=1)
    figures = []
    for j, joint in enumerate(context.joints):
        lines: list[Layer] = []
        for k, (key, values) in enumerate(result.rollouts.items()):
            color, dash = style(k)
            x, y = np.array(result.horizons)[finite], values[finite, j]
            # One horizon alone makes no line.
            lines += [Line(x, y, color, WORDS[key], 2.0, dash), Dots(x, y, color, radius=3.5)]
        panel = Panel(f"distance [{superscripts(units[joint])}]", lines, 220)
        figures.append(single(f"rollout-{j}", joint, "", Plot("time since the start [s]", (panel,))))
    return [Paragraph(words), Table(head, rows, range(1, len(head))), Group("rollout-group", figures, (), "two")]


SECTIONS: tuple[Section, ...] = (
    NamedSection("tracking", "Feed-forward", _tracking),
    NamedSection("rollout", "In simulation", _rollouts),
)


def use_report(path: Path, result: Use) -> None:
    """Write the report of a model in use as one HTML file.

    Raises
    ------
    ScaraIdentError
        If the file cannot be written.
    """
    content = use_dict(result)
    Page(
        f"The model in use, {content['robot']}",
        "feed-forward on virtual arms, and simulation against recordings",
        content["summary"],
        parts("use", SECTIONS, UseContext(result, content)),
    ).write(path)
