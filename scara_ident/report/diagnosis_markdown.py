"""A diagnosis in Markdown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from scara_ident.diagnosis.diagnose import Diagnosis
from scara_ident.estimation.run_variation import unit_of_kind
from scara_ident.manners import several
from scara_ident.report.diagnosis import beyond_chance, diagnosis_dict
from scara_ident.report.left_out import left_out_words
from scara_ident.robot.robot import Robot


def diagnosis_markdown(
    diagnosis: Diagnosis, pictures: Sequence[tuple[str, str]] = (), content: Mapping[str, Any] | None = None
) -> str:
    """Return the story as Markdown.

    Parameters
    ----------
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
        if part["before"]:
            head = ("joint", "before", "after", "before, share", "after, share")
            keys = ("before", "after", "before_relative", "after_relative")
            rows = [
                (joint, *(_cell(part[key][joint], key.endswith("relative")) for key in keys))
                for joint in diagnosis.robot.joints
            ]
            rows += [
                (f"{joint}, own offsets", _cell(before), _cell(part["after_own_offset"][joint]), "", "")
                for joint, before in part.get("before_own_offset", {}).items()
            ]
            lines += _table(f"Error on the {kind} recordings", head, rows)
    lines += ["", left_out_words(content)]
    if pictures:
        lines += ["", "## Residual before and after"]
        for title, name in pictures:
            lines += ["", f"### {title}", "", f"![{title}]({name})"]
    if content["moved"]:
        rows = [
            (m["name"], _cell(m["urdf"]), f"{m['before']:.4g}", f"{m['after']:.4g}", f"{m['in_std']:+.1f}")
            for m in content["moved"]
        ]
        head = ("name", "URDF", "before", "after", "in std")
        lines += _table("Parameters that changed when the effects were added", head, rows)
    lines += _certainty(content, diagnosis)
    shown = beyond_chance(content["candidates"])
    rows = [(row["label"], f"{row['gain']:.2%}", f"{row['p_value']:.1e}", row["decision"], row["why"]) for row in shown]
    if others := len(content["candidates"]) - len(shown):
        rows.append((several(others, "other"), "", "", "", "not believed: no better than chance, see diagnosis.json"))
    lines += _table("Candidates", ("candidate", "gain held out", "p", "decision", "why"), rows)
    if content["not_identifiable"]:
        rows = [
            (
                row["effect"], ", ".join(row["joints"]) or "-", ", ".join(row["absorbed_by"]) or "no torque at all",
                row["opened_by"],
            )
            for row in content["not_identifiable"]
        ]  # fmt: skip
        lines += _table(
            "What no recording of this kind can show", ("effect", "joints", "absorbed by", "opened by"), rows
        )
    if content["worth"] is not None:
        lines += ["", "## What the effects cost", "", *content["worth"]["summary"]]
    return "\n".join(lines) + "\n"


def _certainty(content: Mapping[str, Any], diagnosis: Diagnosis) -> list[str]:
    """Return events, what is worth a look, whether what is left is noise, and how runs differ, as Markdown."""
    lines: list[str] = []
    rows: list[tuple[str, ...]]
    if content["events"]:
        rows = [
            (
                row["recording"], f"{row['from']:.2f}", f"{row['to']:.2f}", *_sizes(row, diagnosis.robot), row["kind"],
            )
            for row in content["events"]
        ]  # fmt: skip
        lines += _table("Events", ("recording", "from", "to", "joints", "rms", "kind"), rows)
    if content["tentative"]:
        rows = [
            (
                row["effect"], row["joint"] or "-", f"{row['gain']:.2%}", f"{row['p_value']:.1e}", row["why"],
                row["settled_by"],
            )
            for row in content["tentative"]
        ]  # fmt: skip
        head = ("effect", "joint", "gain", "p over all tried", "why not", "settled by")
        lines += _table("Worth a look, not added to the model", head, rows)
    rows = [
        (joint, "yes" if row["noise"] else "no", row["by"] or "-", _cell(row["detection_limit"], True), row["why"])
        for joint, row in content["evidence"].items()
    ]
    lines += _table("Is what is left noise?", ("joint", "shown", "by", "detection limit", "why"), rows)
    if content["run_variation"]:
        rows = [
            (joint, kind, f"{std:.3g}", unit_of_kind(diagnosis.robot, joint, kind))
            for joint, kinds in content["run_variation"].items()
            for kind, std in kinds.items()
        ]
        lines += _table("How runs differ", ("joint", "what", "std between runs", "unit"), rows)
    return lines


def _sizes(row: Mapping[str, Any], robot: Robot) -> tuple[str, str]:
    """Return the joints of an event, the one with the largest torque first, and their torques."""
    sizes = row.get("rms_by_joint", {row["joints"][0]: row["rms"]})
    largest = sorted(sizes, key=lambda joint: -sizes[joint])
    said = (f"{sizes[joint]:.3g} {robot.torque_unit(robot.joints.index(joint))}" for joint in largest)
    return ", ".join([*largest, *(joint for joint in row["joints"] if joint not in sizes)]), ", ".join(said)


def _table(title: str, head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return a heading with a table below it."""
    top, *below = (f"| {' | '.join(row)} |" for row in (head, *rows))
    return ["", f"## {title}", "", top, "|" + "---|" * len(head), *below]


def _cell(value: float | None, share: bool = False) -> str:
    if value is None or np.isnan(value):
        return "-"
    return f"{value:.1%}" if share else f"{value:.4g}"
