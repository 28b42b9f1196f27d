"""All checks together."""

from __future__ import annotations

from scara_ident import paper


def test_the_report_is_the_same_each_time(report: paper.PaperReport) -> None:
    assert paper.check_paper() == report
