"""What the printed trajectories and Table 5 give."""

from __future__ import annotations

import pytest

from scara_ident import paper


def rows(report: paper.PaperReport, section: str, **fields: str) -> list[paper.Check]:
    found = [c for c in report.section(section) if all(getattr(c, k) == v for k, v in fields.items())]
    assert found
    return found


def test_indexes_and_speeds_agree_and_only_one_acceleration_does(report: paper.PaperReport) -> None:
    table1 = report.section("Table 1")
    assert {c.tolerance for c in table1 if c.quantity == "J_d"} == {0.02}
    assert {c.tolerance for c in table1 if c.quantity == "J_k"} == {0.10}
    assert all(c.agrees for c in table1 if c.quantity != "peak acceleration")
    agreeing = [(c.trajectory, c.joint) for c in table1 if c.quantity == "peak acceleration" and c.agrees]
    assert agreeing == [("OJD", "joint2")]


def test_peaks_are_those_of_the_printed_formulas(report: paper.PaperReport) -> None:
    """Figures found independently."""
    found = {(c.quantity, c.trajectory, c.joint): round(c.computed, 2) for c in report.section("Table 1")}
    for trajectory, speeds, accelerations in (
        ("OJK", (1.27, 1.29), (4.31, 1.73)),
        ("OJD", (3.00, 2.57), (4.13, 3.03)),
    ):
        for joint in (1, 2):
            assert found["peak velocity", trajectory, f"joint{joint}"] == speeds[joint - 1]
            assert found["peak acceleration", trajectory, f"joint{joint}"] == accelerations[joint - 1]


def test_OJD_asks_for_more_tool_acceleration_than_allowed(report: paper.PaperReport) -> None:
    found = {c.trajectory: c for c in rows(report, "Limits", quantity="tool acceleration")}
    assert found["OJD"].agrees is False
    assert round(found["OJD"].computed, 1) == 13.2
    assert found["OJK"].agrees is True


def test_OJD_as_printed_leaves_the_range_of_joint_1_by_less_than_a_milliradian(
    report: paper.PaperReport,
) -> None:
    (row,) = rows(report, "Limits", quantity="lower position limit", trajectory="OJD", joint="joint1")
    assert row.agrees is False
    assert row.computed == pytest.approx(1.57 - 2.18166, abs=1e-5)
    assert row.printed is not None
    assert 0.0 < row.printed - row.computed < 1e-3


def test_the_OJD_column_predicts_the_printed_torque_within_5_percent(report: paper.PaperReport) -> None:
    section = "Torque rms from Table 5"
    judged = rows(report, section, quantity="torque rms, parameters of OJD")
    assert len(judged) == 4
    assert all(c.agrees and c.tolerance == 0.05 for c in judged)
    found = {(c.trajectory, c.joint): c.computed for c in judged}
    for key, value in {
        ("OJK", "joint1"): 0.5145,
        ("OJK", "joint2"): 0.1293,
        ("OJD", "joint1"): 0.5982,
        ("OJD", "joint2"): 0.1697,
    }.items():
        assert found[key] == pytest.approx(value, abs=2e-4)
    others = [c for c in report.section(section) if c not in judged]
    assert len(others) == 16
    assert all(c.agrees is None for c in others)


def test_table_5_implies_the_prediction_errors_of_table_4(report: paper.PaperReport) -> None:
    section = report.section("Table 4 from Table 5")
    assert len(section) == 16
    assert all(c.agrees for c in section)
