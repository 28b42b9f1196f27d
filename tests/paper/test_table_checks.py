"""The printed tables against each other."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from scara_ident import paper
from scara_ident.paper import table_checks


@pytest.mark.parametrize("table", ["Table 2", "Table 3", "Table 4"])
def test_printed_averages_include_the_diagonal(report: paper.PaperReport, table: str) -> None:
    first, *averages = report.section(f"Averages of {table}")
    assert first.quantity.endswith("diagonal included")
    assert first.computed == 20.0
    assert "reproduces 0 of 20" in first.comment or "reproduces 1 of 20" in first.comment
    assert len(averages) == 22
    assert all(c.agrees for c in averages)


def test_table_3_is_table_2_normalised(report: paper.PaperReport) -> None:
    section = report.section("Table 3 from Table 2")
    assert len(section) == 10
    assert all(c.agrees for c in section)


def test_residuals_exceed_the_repeatability_of_the_torque_but_for_L2(report: paper.PaperReport) -> None:
    section = report.section("Own errors and noise")
    assert {(c.trajectory, bool(c.agrees)) for c in section} == {
        *((name, False) for name in ("CI", "L1", "OJK", "OJD")),
        ("L2", True),
    }


def test_a_wrong_average_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    average = ((*paper.TABLE_2.row_average[0][:4], 1.390), paper.TABLE_2.row_average[1])
    monkeypatch.setattr(table_checks, "TABLE_2", dataclasses.replace(paper.TABLE_2, row_average=average))
    differing = [c for c in table_checks.averages() if c.agrees is False]
    assert [(c.quantity, c.trajectory) for c in differing if c.trajectory] == [("row average", "OJD")]


def with_cell(table: paper.ErrorTable, joint: int, row: int, column: int, value: float) -> paper.ErrorTable:
    errors: Any = np.array(table.errors)
    errors[joint, row, column] = value
    return dataclasses.replace(table, errors=errors.tolist())


def test_a_wrong_cell_of_table_3_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table_checks, "TABLE_3", with_cell(paper.TABLE_3, 1, 0, 2, 4.485))
    (row,) = [c for c in table_checks.normalisation() if c.agrees is False]
    assert (row.trajectory, row.joint, row.quantity) == ("CI", "joint2", "worst cell, parameters of L2")


def test_an_own_error_that_is_not_the_least_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table_checks, "TABLE_4", with_cell(paper.TABLE_4, 0, 4, 4, 0.056))
    differing = [c for c in table_checks.own_errors() if c.agrees is False]
    assert [(c.trajectory, c.joint) for c in differing] == [("OJD", "joint1")]


def test_a_reduced_model_that_fits_better_than_the_complete_one_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(table_checks, "TABLE_4", with_cell(paper.TABLE_4, 0, 1, 1, 0.070))
    differing = [c for c in table_checks.own_errors() if c.agrees is False]
    assert [(c.trajectory, c.joint) for c in differing] == [("L1", "both")]
