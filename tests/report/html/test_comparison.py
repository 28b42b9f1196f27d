"""The page of a comparison."""

from __future__ import annotations

from tests.report.html.document import document


def test_a_comparison_shows_every_trajectory_against_every_other(compared):
    found = document(compared)
    assert {"trajectories", "errors", "parameters", "friction"} <= set(found.sections)
    assert found.words.count("predicted \\ from") == 2
