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
    escape,
    heading,
    listing,
    paragraph,
    superscripts,
    table,
)
from scara_ident.report.html.plot import Figure, Layer, Line, Panel, Plot, single

COLORS = ("blue", "vermillion", "green", "orange", "purple", "black")
DASHES = ("", "7 3", "2 3")
# Ratio to the own error at which a cell has its full colour.
FULL_RATIO = 10.0


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
    sections = [
        Section("errors", "Every trajectory from every other", _error_blocks(content, names, joints)),
        Section("parameters", "Parameters", _parameter_blocks(content, names)),
    ]
    if content.get("characteristics"):
        sections.insert(0, Section("trajectories", "Trajectories", _characteristics(content, names, joints)))
    if content.get("friction"):
        words = "Friction as every trajectory sees it: dotted where it goes beyond the trajectory's own speeds, which is extrapolation."
        sections.append(
            Section("friction", "Friction", (paragraph(words), _friction_group(content["friction"], names)))
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


def _characteristics(content: Mapping[str, Any], names: Sequence[str], joints: Sequence[str]) -> list[Block]:
    rows: list[list[Cell | str]] = []
    for name in names:
        what = content["characteristics"][name]
        row: list[Cell | str] = [
            Cell(escape(name), "name"),
            _number(what.get("log_det"), 4),
            _number(what.get("condition")),
        ]
        for key in ("sigma", "peak_velocity", "peak_acceleration"):
            values = what.get(key) or {}
            row += [_number(values.get(joint)) for joint in joints]
        rows.append([*row, str(len(what.get("recordings", ())))])
    head = ["trajectory", "J_d", "J_k"]
    for words in ("repeatability", "peak velocity", "peak acceleration"):
        head += [f"{words}, {joint}" for joint in joints]
    head.append("runs")
    return [table(head, rows, numeric=range(1, len(head)))]


def _error_blocks(content: Mapping[str, Any], names: Sequence[str], joints: Sequence[str]) -> list[Block]:
    blocks: list[Block] = [
        paragraph(
            "Rms error on the trajectory of the row with parameters from that of the column. The colour is the ratio to the row's own error, "
            f"white at 1 and full at {FULL_RATIO:g}; in brackets what the covariance of the parameters promises: where the error is far above it, bias is at work and not noise."
        )
    ]
    for joint in joints:
        rows: list[list[Cell | str]] = []
        for predicted in names:
            own = content["errors"][predicted][predicted][joint]
            row: list[Cell | str] = [Cell(escape(predicted), "name"), _number(content["torque_rms"][predicted][joint])]
            for estimated in names:
                error = content["errors"][predicted][estimated][joint]
                promised = content.get("predicted_by_covariance", {}).get(predicted, {}).get(estimated, {}).get(joint)
                bracket = "" if promised is None else f" ({_number(promised, 2)})"
                row.append(Cell(escape(_number(error) + bracket), "num", _ratio_strength(error, own)))
            rows.append([*row, _number(_mean(content["errors"][predicted][other][joint] for other in names))])
        average: list[Cell | str] = [Cell("average", "name"), ""]
        average += [_number(_mean(content["errors"][other][name][joint] for other in names)) for name in names]
        head = ["predicted \\ from", "torque", *names, "average"]
        blocks += [heading(joint), table(head, [*rows, [*average, ""]], numeric=range(1, len(head)))]
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
            row.append(Cell(f"{value:.4g} ± {std:.1g}", "num", strength))
        rows.append([*row, superscripts(entries[0].get("unit", ""))])
    words = "Colour: how many of its own standard deviations a value lies above (blue) or below (vermillion) the median of the trajectories, full at six. Strong colours are disagreement that noise does not explain."
    return [paragraph(words), table(("name", *names, "unit"), rows, numeric=range(1, len(names) + 1))]


def _friction_group(friction: Mapping[str, Any], names: Sequence[str]) -> Group:
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
                f"friction-{len(figures)}", f"Friction of {joint}", "", Plot("speed", (Panel("friction", layers, 230),))
            )
        )
    return Group("friction-group", figures, (), "two")


def _number(value: float | None, digits: int = 3) -> str:
    return "–" if value is None or not np.isfinite(value) else f"{value:.{digits}g}"
