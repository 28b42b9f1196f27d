"""Parameters, their correlation and how they settled."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from scara_ident.effects import Parameter
from scara_ident.report.html import parameters
from scara_ident.report.html.parameters import cheap_history, convergence_group, parameter_table, unsure


def test_many_parameters_settle_in_pages(result):
    history = result.history or cheap_history(result.training)
    columns = tuple(replace(result.model.columns[0], name=f"p{k}") for k in range(30))
    many = SimpleNamespace(
        model=SimpleNamespace(columns=columns, robot=result.model.robot), value=np.repeat(result.estimate.value[:1], 30)
    )
    wide = SimpleNamespace(
        samples=history.samples, value=np.repeat(history.value[:, :1], 30, 1), std=np.repeat(history.std[:, :1], 30, 1)
    )
    group = convergence_group(many, wide, result.training)
    assert [selector.options for selector in group.selectors] == [("p0 … p11", "p12 … p23", "p24 … p29")]
    shown = [plot.panels[0].label for figure in group.figures for plot in figure.variants.values()]
    assert sorted(label.split(" ")[0] for label in shown) == sorted(f"p{k}" for k in range(30))


def test_the_urdfs_value_stands_beside_each_parameter_that_it_has(result):
    table = parameter_table(result.estimate)
    column = list(table.head).index("URDF")
    stated = {row[0].text: row[column].text for row in table.rows}
    assert float(stated["P_d1"]) > 0.0
    # Of friction a URDF of links says nothing.
    assert stated["a01"] == "–"


def test_what_cancels_in_the_urdf_is_0_and_no_rounding(result, monkeypatch):
    values = np.full(len(result.model.columns), np.nan)
    values[:2] = 16.0, -2e-16
    monkeypatch.setattr(parameters, "urdf_values", lambda model: values)
    assert [row[2].text for row in parameter_table(result.estimate).rows[:3]] == ["16.00", "0", "–"]


@pytest.mark.parametrize(
    ("std", "symmetric_power", "shown"),
    [
        (150.0, -1.0, "1.5e+02"),
        (1504.0, -1.0, "2160 to 17700 (95 %)"),
        (2000.0, -1.0, "above 1880 (95 %)"),
        (38450.0, 0.0, "unknown"),
        (np.inf, 1.0, "unknown"),
    ],
)
def test_the_table_has_the_interval_where_a_standard_deviation_says_too_little(
    std: float, symmetric_power: float, shown: str
):
    assert unsure(Parameter(3845.0, std, "N m/rad", symmetric_power)) == shown
