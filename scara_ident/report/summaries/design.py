"""Summary, columns and figure of a design: its criteria and limits, and the motion."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from scara_ident.excitation.design import Design
from scara_ident.excitation.output import RATE, excitation_dict, trajectory_columns
from scara_ident.report.summaries.words import table, text_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

# The content of ``excitation.json``.
content = excitation_dict


def summary(design: Design) -> str:
    """Return the result in sentences, and every limit with what is used of it."""
    held = excitation_dict(design)
    return text_of(*held["summary"], limit_table(design), *(f"note: {note}" for note in held["notes"]))


def columns(design: Design) -> dict[str, Any]:
    """Return the first trajectory, sampled and named as in ``trajectory.csv``."""
    return trajectory_columns(design.trajectories[0], RATE)


def figure(design: Design) -> Figure:
    """Draw the motion, its phases, the tool's path and the standard deviations to come."""
    from scara_ident.report.drawing import canvas
    from scara_ident.report.pictures import design_figures

    return canvas(*design_figures(design))


def limit_table(design: Design) -> Table:
    """Return every limit and what the motion reaches of it."""
    rows = table("limits", "limit", "bound", "reached", right=("bound", "reached"))
    for each in design.reached:
        rows.add_row(each.name, f"{each.bound:.4g} {each.unit}", f"{each.reached:.4g} {each.unit}")
    return rows
