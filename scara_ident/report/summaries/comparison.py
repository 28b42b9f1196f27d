"""Summary, columns and figure of a comparison: every trajectory's parameters on every trajectory."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from scara_ident.identification.compare import Comparison
from scara_ident.report.comparison import comparison_dict
from scara_ident.report.plot import Dots, Panel, Plot, single, style
from scara_ident.report.summaries.words import table, text_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table

# The content of ``comparison.json``.
content = comparison_dict


def summary(comparison: Comparison) -> str:
    """Return the trajectories and the errors as tables, and the result in sentences."""
    held = comparison_dict(comparison)
    notes = [f"note: {note}" for note in comparison.notes]
    return text_of(*notes, *tables(held), *held["summary"])


def columns(comparison: Comparison) -> dict[str, Any]:
    """Return a row for each trajectory predicted, trajectory whose parameters predict it, and joint."""
    names = [item.name for item in comparison.trajectories]
    joints = comparison.model.robot.joints
    cells = [(i, k, j) for i in range(len(names)) for k in range(len(names)) for j in range(len(joints))]
    return {
        "predicted": [names[i] for i, _, _ in cells],
        "parameters_from": [names[k] for _, k, _ in cells],
        "joint": [joints[j] for _, _, j in cells],
        "rms": [float(comparison.errors[cell]) for cell in cells],
        "expected": [float(comparison.expected[cell]) for cell in cells],
    }


def figure(comparison: Comparison) -> Figure:
    """Draw the error on every trajectory of the parameters from each, joint by joint."""
    from scara_ident.report.drawing import canvas

    names = tuple(item.name for item in comparison.trajectories)
    robot, places = comparison.model.robot, np.arange(float(len(names)))
    rows = [
        [
            single(
                "errors",
                f"{joint}: parameters from each trajectory",
                "",
                Plot(
                    "",
                    (
                        Panel(
                            f"rms error [{robot.torque_unit(j)}]",
                            [
                                Dots(places, comparison.errors[:, k, j], style(k)[0], name, radius=4.0)
                                for k, name in enumerate(names)
                            ],
                            220,
                        ),
                    ),
                    names=names,
                ),
            )
        ]
        for j, joint in enumerate(robot.joints)
    ]
    return canvas(f"{robot.name}: {comparison.model.name} model by {comparison.method}", rows)


def tables(held: dict[str, Any]) -> list[Table]:
    """Return the trajectories and, joint by joint, the errors, of the content of ``comparison.json``."""
    names = held["trajectories"]
    what = table("trajectories", "trajectory", "J_d", "J_k", "runs", right=("J_d", "J_k", "runs"))
    for name in names:
        row = held["characteristics"][name]
        what.add_row(name, f"{row['log_det']:.2f}", f"{row['condition']:.3g}", str(len(row["recordings"])))
    found = [what]
    for joint in held["joints"]:
        rows = table(
            f"{joint}: rms error (what noise explains), parameters from", "predicted", "torque", *names, "average",
            right=("torque", *names, "average"),
        )  # fmt: skip
        for name in names:
            promised = held["predicted_by_covariance"][name]
            cells = [
                f"{_known(held['errors'][name][other][joint], 3)} ({_known(promised[other][joint], 2)})"
                for other in names
            ]
            average = _known(held["average_of_predicted"][name][joint], 3)
            rows.add_row(name, f"{held['torque_rms'][name][joint]:.3g}", *cells, average)
        averages = [_known(held["average_of_estimated"][other][joint], 3) for other in names]
        rows.add_row("average", "", *averages, "")
        found.append(rows)
    return found


def _known(value: float, digits: int) -> str:
    """Return a number in few digits; a dash where it is not known."""
    return f"{value:.{digits}g}" if np.isfinite(value) else "-"
