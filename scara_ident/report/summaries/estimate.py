"""Summary, columns and figure of an estimate: its parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from scara_ident.estimation.estimate import Estimate
from scara_ident.estimation.saved import estimate_dict
from scara_ident.model.urdf_values import urdf_values
from scara_ident.report.plot import Dots, Panel, Plot, single
from scara_ident.report.summaries.words import number, table, text_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table


def summary(estimate: Estimate) -> str:
    """Return the parameters as a table."""
    return text_of(parameter_table(estimate))


def content(estimate: Estimate) -> dict[str, Any]:
    """Return what `load_estimate` reads."""
    return {"estimate": estimate_dict(estimate)}


def columns(estimate: Estimate) -> dict[str, Any]:
    """Return a row for each parameter; a standard deviation is infinite where the data leave the parameter open."""
    described = estimate.model.columns
    return {
        "name": [column.name for column in described],
        "joint": [column.joint for column in described],
        "value": estimate.value.tolist(),
        "std": estimate.std.tolist(),
        "urdf": urdf_values(estimate.model).tolist(),
        "unit": [column.unit for column in described],
        "undetermined": estimate.undetermined.tolist(),
        "meaning": [column.meaning for column in described],
    }


def figure(estimate: Estimate) -> Figure:
    """Draw the size of every parameter and its standard deviation."""
    from scara_ident.report.drawing import canvas

    places = np.arange(float(len(estimate.value)))
    size = np.where(estimate.value != 0.0, np.abs(estimate.value), np.nan)
    spread = np.where(np.isfinite(estimate.std) & (estimate.std > 0.0), estimate.std, np.nan)
    layers = [Dots(places, size, "blue", "size", radius=4.0), Dots(places, spread, "vermillion", "std", radius=4.0)]
    panel = Panel("in the parameter's unit", layers, 260, log=True)
    plot = Plot("", (panel,), names=estimate.model.names)
    return canvas(title(estimate), [[single("parameters", "Parameters", "", plot)]])


def title(estimate: Estimate) -> str:
    """Return what was estimated, and how."""
    return f"{estimate.model.robot.name}: {estimate.model.name} model by {estimate.method}"


def parameter_table(estimate: Estimate) -> Table:
    """Return name, value, standard deviation, the URDF's value, unit and meaning of every parameter."""
    right = ("value", "std", "URDF")
    rows = table(title(estimate), "name", *right, "unit", "meaning", right=right)
    table_rows = zip(estimate.model.columns, estimate.value, estimate.std, urdf_values(estimate.model), strict=True)
    for column, value, std, stated in table_rows:
        urdf = "-" if np.isnan(stated) else f"{stated:.4g}"
        rows.add_row(column.name, number(value, std), f"{std:.2g}", urdf, column.unit, column.meaning)
    return rows
