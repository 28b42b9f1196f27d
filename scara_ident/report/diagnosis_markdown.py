"""The story of a diagnosis in Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from scara_ident.diagnosis.diagnose import Diagnosis
from scara_ident.estimation.run_variation import unit_of_kind
from scara_ident.report.diagnosis import diagnosis_dict


def diagnosis_markdown(
    diagnosis: Diagnosis, pictures: Sequence[tuple[str, str]] = (), content: Mapping[str, Any] | None = None
) -> str:
    """Return the story as Markdown.

    Parameters
    ----------
    diagnosis : Diagnosis
    pictures : sequence of (str, str), optional
        Title and file name of figures that stand beside it; see `scara_ident.report.pictures`.
    content : mapping, optional
        What `diagnosis_dict` returns, where it is at hand.
    """
    content = diagnosis_dict(diagnosis) if content is None else content
    lines = [f"# Diagnosis of {diagnosis.robot.name}: {diagnosis.verdict}", ""]
    lines += [f"{sentence}  " for sentence in content["summary"]]
    for kind in ("training", "validation"):
        part = content[kind]
        if not part["before"]:
            continue
        lines += [
            "",
            f"## Error on the {kind} recordings",
            "",
            "| joint | before | after | before, share | after, share |",
        ]
        lines += ["|---|---|---|---|---|"]
        for joint in diagnosis.robot.joints:
            cells = [part[key][joint] for key in ("before", "after", "before_relative", "after_relative")]
            lines.append(f"| {joint} | " + " | ".join(_cell(x, k > 1) for k, x in enumerate(cells)) + " |")
        for joint, before in part.get("before_own_offset", {}).items():
            after = part["after_own_offset"][joint]
            lines.append(f"| {joint}, own offsets | {_cell(before, share=False)} | {_cell(after, share=False)} | | |")
    if pictures:
        lines += ["", "## Residual before and after"]
        for title, name in pictures:
            lines += ["", f"### {title[:1].upper()}{title[1:]}", "", f"![{title}]({name})"]
    if content["moved"]:
        lines += [
            "",
            "## Parameters that moved when the effects came in",
            "",
            "| name | URDF | before | after | in std |",
        ]
        lines += ["|---|---|---|---|---|"]
        lines += [
            f"| {m['name']} | {_cell(m['urdf'], share=False)} | {m['before']:.4g} | {m['after']:.4g} | {m['in_std']:+.1f} |"
            for m in content["moved"]
        ]
    lines += _certainty(content, diagnosis)
    lines += ["", "## Candidates", "", "| candidate | gain held out | p | decision | why |", "|---|---|---|---|---|"]
    for row in content["candidates"]:
        lines.append(
            f"| {row['label']} | {row['gain']:.2%} | {row['p_value']:.1e} | {row['decision']} | {row['why']} |"
        )
    if content["not_identifiable"]:
        lines += ["", "## What no such recording can show", ""]
        lines += ["| effect | joints | absorbed by | opened by |", "|---|---|---|---|"]
        lines += [
            f"| {row['effect']} | {', '.join(row['joints']) or '-'} | {', '.join(row['absorbed_by']) or 'no torque at all'} | "
            f"{row['opened_by']} |"
            for row in content["not_identifiable"]
        ]
    if content["worth"] is not None:
        lines += ["", "## What the effects cost", "", *content["worth"]["summary"]]
    return "\n".join(lines) + "\n"


def _certainty(content: Mapping[str, Any], diagnosis: Diagnosis) -> list[str]:
    """Return events, what is worth a look, whether what is left is noise, and how runs differ, as Markdown."""
    lines = []
    if content["events"]:
        lines += ["", "## Events", "", "| recording | from | to | joints | rms | kind |", "|---|---|---|---|---|---|"]
        lines += [
            f"| {row['recording']} | {row['from']:.2f} | {row['to']:.2f} | {', '.join(row['joints'])} | {row['rms']:.3g} | {row['kind']} |"
            for row in content["events"]
        ]
    if content["tentative"]:
        lines += [
            "",
            "## Worth a look, not added",
            "",
            "| effect | joint | gain | p over all tried | why not | settled by |",
        ]
        lines += ["|---|---|---|---|---|---|"]
        lines += [
            f"| {row['effect']} | {row['joint'] or '-'} | {row['gain']:.2%} | {row['p_value']:.1e} | {row['why']} | {row['settled_by']} |"
            for row in content["tentative"]
        ]
    lines += [
        "",
        "## Is what is left noise?",
        "",
        "| joint | shown | by | detection limit | why |",
        "|---|---|---|---|---|",
    ]
    lines += [
        f"| {joint} | {'yes' if row['noise'] else 'no'} | {row['by'] or '-'} | {_cell(row['detection_limit'], share=True)} | {row['why']} |"
        for joint, row in content["evidence"].items()
    ]
    if content["run_variation"]:
        lines += ["", "## How runs differ", "", "| joint | what | std between runs | unit |", "|---|---|---|---|"]
        lines += [
            f"| {joint} | {kind} | {std:.3g} | {unit_of_kind(diagnosis.robot, joint, kind)} |"
            for joint, kinds in content["run_variation"].items()
            for kind, std in kinds.items()
        ]
    return lines


def _cell(value: float | None, share: bool) -> str:
    if value is None or np.isnan(value):
        return "-"
    return f"{value:.1%}" if share else f"{value:.4g}"
