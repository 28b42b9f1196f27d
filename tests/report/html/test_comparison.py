"""The page of a comparison."""

from __future__ import annotations

from scara_ident.report.html.comparison import ComparisonContext, _error_cell, _parameter_cell, _trajectories
from tests.report.html.document import document


def test_a_comparison_shows_every_trajectory_against_every_other(compared):
    found = document(compared)
    assert {"trajectories", "errors", "parameters", "friction"} <= set(found.sections)
    assert found.words.count("predicted \\ from") == 2


def test_what_no_trajectory_has_takes_no_column():
    """Without repetitions no runs scatter."""
    what = {"log_det": 50.0, "condition": 1e4, "sigma": {"j": None}, "peak_velocity": {"j": 2.0}, "recordings": ["A"]}
    content = {"trajectories": ["A"], "joints": ["j"], "characteristics": {"A": what}}
    _, table = _trajectories(ComparisonContext(content))
    assert table.head == ["trajectory", "J_d", "J_k", "peak velocity, j", "runs"]
    assert len(table.rows[0]) == len(table.head)


def test_a_value_and_its_standard_deviation_end_on_the_same_digit():
    cell = _parameter_cell(16.16623, 0.00471, 16.0)
    assert (cell.text, cell.note) == ("16.1662", "± 0.0047")


def test_what_the_covariance_does_not_promise_is_a_dash():
    assert _error_cell(0.2, 0.1, None).note == "(–)"
    assert "▲" not in _error_cell(0.2, 0.1, None).text
