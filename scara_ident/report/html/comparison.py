"""The report of a comparison: the tables as heat maps, friction from every trajectory."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident.report.html.page import (
    Block,
    Cell,
    Group,
    Page,
    Section,
    colour_scale,
    escape,
    heading,
    listing,
    number,
    paragraph,
    superscripts,
    table,
)
from scara_ident.report.html.parameters import digits
from scara_ident.report.html.plot import Figure, Layer, Line, Panel, Plot, single

COLORS = ("blue", "vermillion", "green", "orange", "purple", "black")
DASHES = ("", "7 3", "2 3")
# Ratio to the own error at which a cell has its full colour.
FULL_RATIO = 10.0
# Ratio to what the covariance promises from which an error is marked as bias.
BIASED = 2.0

# By joint and kind of quantity.
Units = Mapping[str, Mapping[str, str]]


def comparison_report(path: Path, content: Mapping[str, Any]) -> None:
    """Write the report of a comparison as one HTML file.

    Parameters
    ----------
    path : Path
    content : mapping
        The content of ``comparison.json``.

    Raises
    ------
    ScaraIdentError
        If the file cannot be written.
    """
    comparison_page(content).write(path)


def comparison_page(content: Mapping[str, Any]) -> Page:
    """Assemble the report of a comparison."""
    names: Sequence[str] = content["trajectories"]
    joints: Sequence[str] = content["joints"]
    units: Units = content.get("units") or {}
    sections = [
        Section("errors", "Every trajectory from every other", _error_blocks(content, names, joints, units)),
        Section("parameters", "Parameters", _parameter_blocks(content, names)),
    ]
    if content.get("characteristics"):
        sections.insert(0, Section("trajectories", "Trajectories", _characteristics(content, names, joints, units)))
    if content.get("friction"):
        words = "Friction as every trajectory sees it: a full line over the speeds that it covers, dotted beyond them, which is extrapolation."
        sections.append(
            Section("friction", "Friction", (paragraph(words), _friction_group(content["friction"], names, units)))
        )
    if content.get("notes"):
        sections.append(Section("notes", "Notes on the data", (listing(content["notes"]),)))
    subtitle = (
        f"{content.get('model', '')} model by {content.get('method', 'least squares')}; {len(names)} trajectories"
    )
    verdict = content.get("summary") or (f"{len(names)} trajectories compared.",)
    return Page(
        f"Comparison of trajectories, {content.get('robot', '')}".rstrip(", "), subtitle.strip(), verdict, sections
    )


def _characteristics(
    content: Mapping[str, Any], names: Sequence[str], joints: Sequence[str], units: Units
) -> list[Block]:
    rows: list[list[Cell | str]] = []
    for name in names:
        what = content["characteristics"][name]
        row: list[Cell | str] = [
            Cell(escape(name), "name"),
            number(what.get("log_det"), 4),
            number(what.get("condition")),
        ]
        for key in ("sigma", "peak_velocity", "peak_acceleration"):
            values = what.get(key) or {}
            row += [number(values.get(joint)) for joint in joints]
        rows.append([*row, str(len(what.get("recordings", ())))])
    head = ["trajectory", "J_d", "J_k"]
    for words, kind in (("scatter of runs", "torque"), ("peak velocity", "velocity"), ("peak acc.", "acceleration")):
        head += [f"{words}, {joint}{_unit(units, joint, kind)}" for joint in joints]
    head.append("runs")
    words = "J_d: what the motion tells of all parameters together (ln det); J_k: condition, small where no parameter is hidden behind others."
    return [paragraph(words), table(head, rows, numeric=range(1, len(head)))]


def _error_blocks(content: Mapping[str, Any], names: Sequence[str], joints: Sequence[str], units: Units) -> list[Block]:
    blocks: list[Block] = [
        paragraph(
            "Rms error on the trajectory of the row with parameters from that of the column. The colour is the ratio to the row's own error, "
            f"none at 1 and full at {FULL_RATIO:g}; in brackets what the covariance of the parameters promises. Where the error is over twice that (▲), bias is at work and not noise."
        ),
        colour_scale("own error", f"{FULL_RATIO:g} times the own error"),
    ]
    for joint in joints:
        rows: list[list[Cell | str]] = []
        for predicted in names:
            own = content["errors"][predicted][predicted][joint]
            row: list[Cell | str] = [Cell(escape(predicted), "name"), number(content["torque_rms"][predicted][joint])]
            for estimated in names:
                error = content["errors"][predicted][estimated][joint]
                promised = content.get("predicted_by_covariance", {}).get(predicted, {}).get(estimated, {}).get(joint)
                bracket = "" if promised is None else f" <small>({number(promised, 2)})</small>"
                biased = "▲ " if promised and error and error > BIASED * promised else ""
                row.append(Cell(f"{biased}{number(error)}{bracket}", "num", _ratio_strength(error, own)))
            rows.append([*row, number(_mean(content["errors"][predicted][other][joint] for other in names))])
        average: list[Cell | str] = [Cell("average", "name"), ""]
        average += [number(_mean(content["errors"][other][name][joint] for other in names)) for name in names]
        head = ["predicted \\ from", "rms torque", *names, "average"]
        blocks += [
            heading(f"{joint}{_unit(units, joint, 'torque')}"),
            table(head, [*rows, [*average, ""]], numeric=range(1, len(head))),
        ]
    return blocks


def _mean(values: Any) -> float | None:
    found = [value for value in values if value is not None]
    return float(np.mean(found)) if found else None


def _ratio_strength(error: float | None, own: float | None) -> float | None:
    if not error or not own:
        return None
    return float(np.clip(np.log(error / own) / np.log(FULL_RATIO), -1.0, 1.0))


def _parameter_blocks(content: Mapping[str, Any], names: Sequence[str]) -> list[Block]:
    parameters = content["parameters"]
    rows: list[list[Cell | str]] = []
    for name in parameters[names[0]]:
        entries = [parameters[trajectory][name] for trajectory in names]
        known = [entry["value"] for entry in entries if entry["value"] is not None]
        middle = float(np.median(known)) if known else 0.0
        row: list[Cell | str] = [Cell(escape(name), "name")]
        for entry in entries:
            value, std = entry["value"], entry["std"]
            if value is None or std is None:
                row.append("undetermined")
                continue
            strength = float(np.clip((value - middle) / (6.0 * std), -1.0, 1.0)) if std else 0.0
            row.append(Cell(f"{digits(value, std)} <small>± {std:.1g}</small>", "num", strength))
        rows.append([*row, Cell(escape(superscripts(entries[0].get("unit", ""))), "unit")])
    words = "Colour: how many of its own standard deviations a value lies above (blue) or below (vermillion) the median of the trajectories, full at six. Strong colours are disagreement that noise does not explain."
    scale = colour_scale("6 std below the median", "6 std above", two_sided=True)
    return [paragraph(words), scale, table(("name", *names, "unit"), rows, numeric=range(1, len(names) + 1))]


def _friction_group(friction: Mapping[str, Any], names: Sequence[str], units: Units) -> Group:
    figures: list[Figure] = []
    for joint, curves in friction.items():
        speed = np.asarray(curves["speed"], dtype=float)
        layers: list[Layer] = []
        for k, name in enumerate(names):
            torque = np.asarray(curves["torque"][name], dtype=float)
            color, dash = COLORS[k % len(COLORS)], DASHES[k // len(COLORS) % len(DASHES)]
            own = speed <= float(curves["fastest"][name]) * (1.0 + 1e-9)
            layers.append(Line(speed, np.where(own, torque, np.nan), color, name, 2.0, dash))
            layers.append(Line(speed, np.where(own, np.nan, torque), color, "", 1.2, "2 4"))
        figures.append(
            single(
                f"friction-{len(figures)}",
                f"Friction of {joint}",
                "",
                Plot(
                    f"speed{_unit(units, joint, 'velocity')}",
                    (Panel(f"friction{_unit(units, joint, 'torque')}", layers, 230),),
                ),
            )
        )
    return Group("friction-group", figures, (), "two")


def _unit(units: Units, joint: str, kind: str) -> str:
    unit = (units.get(joint) or {}).get(kind)
    return f" [{superscripts(unit)}]" if unit else ""
