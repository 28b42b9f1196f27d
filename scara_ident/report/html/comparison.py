"""The report of a comparison: the tables as heat maps, friction from every trajectory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident.report.html.blocks import (
    Block,
    Cell,
    Group,
    Heading,
    Paragraph,
    Scale,
    Table,
    estimator_words,
    name,
    number,
    superscripts,
)
from scara_ident.report.html.page import Page, parts
from scara_ident.report.html.parameters import digits
from scara_ident.report.html.section import NamedSection, Section, notes_section
from scara_ident.report.plot import Figure, Layer, Line, Panel, Plot, single, style

# Ratio to the own error at which a cell has its full colour.
FULL_RATIO = 10.0
# Ratio to what the covariance promises from which an error is marked as bias.
BIASED = 2.0
# What a trajectory is like, joint by joint: key, words, kind of unit. Without repetitions no runs scatter.
CHARACTERISTICS = (
    ("sigma", "scatter of runs", "torque"),
    ("peak_velocity", "peak velocity", "velocity"),
    ("peak_acceleration", "peak acc.", "acceleration"),
)


@dataclass(frozen=True, eq=False)
class ComparisonContext:
    """What the sections of a comparison draw from: the content of ``comparison.json``."""

    content: Mapping[str, Any]

    @property
    def trajectories(self) -> Sequence[str]:
        """Names of the trajectories."""
        return tuple(self.content["trajectories"])

    @property
    def joints(self) -> Sequence[str]:
        """Names of the joints."""
        return tuple(self.content["joints"])

    def unit(self, joint: str, kind: str) -> str:
        """Return the unit of a kind of quantity of a joint, as a label has it."""
        unit = ((self.content.get("units") or {}).get(joint) or {}).get(kind)
        return f" [{superscripts(unit)}]" if unit else ""


def _trajectories(context: ComparisonContext) -> list[Block]:
    """What every trajectory is like."""
    if not context.content.get("characteristics"):
        return []
    every = context.content["characteristics"].values()
    columns = [
        (key, words, kind)
        for key, words, kind in CHARACTERISTICS
        if any(value is not None for what in every for value in (what.get(key) or {}).values())
    ]
    rows: list[list[Cell | str]] = []
    for trajectory in context.trajectories:
        what = context.content["characteristics"][trajectory]
        row: list[Cell | str] = [name(trajectory), number(what.get("log_det"), 4), number(what.get("condition"))]
        for key, *_ in columns:
            row += [number((what.get(key) or {}).get(joint)) for joint in context.joints]
        rows.append([*row, str(len(what.get("recordings", ())))])
    head = ["trajectory", "J_d", "J_k"]
    head += [f"{what}, {joint}{context.unit(joint, kind)}" for _, what, kind in columns for joint in context.joints]
    head.append("runs")
    words = "J_d: information of the motion about all parameters together (ln det); J_k: condition number, small if no combination of parameters is poorly excited."
    return [Paragraph(words), Table(head, rows, range(1, len(head)))]


def _errors(context: ComparisonContext) -> list[Block]:
    """The error on every trajectory with the parameters from every other."""
    words = (
        "Rms error on the trajectory of the row with the parameters from the trajectory of the column. The colour is "
        f"the ratio to the row's own error: no colour at 1, full colour at {FULL_RATIO:g}. In brackets: the error that "
        f"the covariance of the parameters predicts, or a dash if a parameter has no standard deviation. An error more "
        f"than twice that value (▲) is bias and not noise."
    )
    blocks: list[Block] = [Paragraph(words), Scale("own error", f"{FULL_RATIO:g} times the own error")]
    for joint in context.joints:
        blocks += [Heading(f"{joint}{context.unit(joint, 'torque')}"), _error_table(context, joint)]
    return blocks


def _error_table(context: ComparisonContext, joint: str) -> Table:
    content, names = context.content, context.trajectories
    errors = {row: {column: content["errors"][row][column][joint] for column in names} for row in names}
    promised = content.get("predicted_by_covariance", {})
    rows: list[list[Cell | str]] = []
    for row in names:
        cells = [
            _error_cell(errors[row][column], errors[row][row], promised.get(row, {}).get(column, {}).get(joint))
            for column in names
        ]
        rows.append([name(row), number(content["torque_rms"][row][joint]), *cells, _mean(errors[row].values())])
    rows.append([name("average"), "", *(_mean(errors[row][column] for row in names) for column in names), ""])
    head = ["predicted \\ from", "rms torque", *names, "average"]
    return Table(head, rows, range(1, len(head)))


def _error_cell(error: float | None, own: float | None, promised: float | None) -> Cell:
    biased = "▲ " if promised and error and error > BIASED * promised else ""
    strength = float(np.clip(np.log(error / own) / np.log(FULL_RATIO), -1.0, 1.0)) if error and own else None
    note = f"({number(promised, 2)})"
    return Cell(f"{biased}{number(error)}", "num", strength, note=note)


def _mean(values: Any) -> str:
    found = [value for value in values if value is not None]
    return number(float(np.mean(found)) if found else None)


def _parameters(context: ComparisonContext) -> list[Block]:
    """Every parameter from every trajectory."""
    parameters, names = context.content["parameters"], context.trajectories
    rows: list[list[Cell | str]] = []
    for parameter in parameters[names[0]]:
        entries = [parameters[trajectory][parameter] for trajectory in names]
        known = [entry["value"] for entry in entries if entry["value"] is not None]
        middle = float(np.median(known)) if known else 0.0
        cells = [_parameter_cell(entry["value"], entry["std"], middle) for entry in entries]
        rows.append(
            [
                name(parameter),
                Cell(number(entries[0].get("urdf"), 4), "num"),
                *cells,
                Cell(superscripts(entries[0].get("unit", "")), "unit"),
            ]
        )
    words = "Colour: by how many of its standard deviations a value is above (blue) or below (vermillion) the median of the trajectories; full colour at six. Noise does not explain strong colours."
    scale = Scale("6 std below the median", "6 std above", two_sided=True)
    return [Paragraph(words), scale, Table(("name", "URDF", *names, "unit"), rows, range(1, len(names) + 2))]


def _parameter_cell(value: float | None, std: float | None, middle: float) -> Cell:
    if value is None or std is None:
        return Cell("undetermined", "num")
    strength = float(np.clip((value - middle) / (6.0 * std), -1.0, 1.0)) if std else 0.0
    return Cell(digits(value, std), "num", strength, note=f"± {number(std, 2)}")


def _friction_curves(context: ComparisonContext) -> list[Block]:
    """Friction over speed, as every trajectory sees it."""
    if not context.content.get("friction"):
        return []
    figures: list[Figure] = []
    for joint, curves in context.content["friction"].items():
        speed = np.asarray(curves["speed"], dtype=float)
        layers: list[Layer] = []
        for k, trajectory in enumerate(context.trajectories):
            torque = np.asarray(curves["torque"][trajectory], dtype=float)
            color, dash = style(k)
            own = speed <= float(curves["fastest"][trajectory]) * (1.0 + 1e-9)
            layers.append(Line(speed, np.where(own, torque, np.nan), color, trajectory, 2.0, dash))
            layers.append(Line(speed, np.where(own, np.nan, torque), color, "", 1.2, "2 4"))
        panel = Panel(f"friction{context.unit(joint, 'torque')}", layers, 230)
        plot = Plot(f"speed{context.unit(joint, 'velocity')}", (panel,))
        figures.append(single(f"friction-{len(figures)}", f"Friction of {joint}", "", plot))
    words = "Friction identified from each trajectory: solid over the speeds that the trajectory covers, dotted where it is extrapolated."
    return [Paragraph(words), Group("friction-group", figures, (), "two")]


SECTIONS: tuple[Section, ...] = (
    NamedSection("trajectories", "Trajectories", _trajectories),
    NamedSection("errors", "Every trajectory predicted with every other's parameters", _errors),
    NamedSection("parameters", "Parameters", _parameters),
    NamedSection("friction", "Friction", _friction_curves),
    notes_section(lambda context: context.content.get("notes")),
)


def comparison_report(path: Path, content: Mapping[str, Any]) -> None:
    """Write the report of a comparison as one HTML file.

    Parameters
    ----------
    content : mapping
        The content of ``comparison.json``.

    Raises
    ------
    ScaraIdentError
        If the file cannot be written.
    """
    trajectories = f"{len(content['trajectories'])} trajectories"
    Page(
        f"Comparison of trajectories, {content.get('robot', '')}".rstrip(", "),
        f"{content.get('model', '')} model by {estimator_words(content.get('method', 'ols'))}; {trajectories}".strip(),
        content.get("summary") or (f"{trajectories} compared.",),
        parts("comparison", SECTIONS, ComparisonContext(content)),
    ).write(path)
