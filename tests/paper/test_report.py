"""The report of all checks."""

from __future__ import annotations

import json

from scara_ident import paper


def test_the_report_goes_through_json_unchanged(report: paper.PaperReport) -> None:
    plain = report.to_dict()
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain
    assert len(plain["checks"]) == len(report.checks)


def test_counts_add_up_to_the_rows(report: paper.PaperReport) -> None:
    counts = report.counts()
    assert [count.section for count in counts] == list(report.sections)
    assert sum(c.agree + c.differ + c.information for c in counts) == len(report.checks)
    assert sum(c.differ for c in counts) == sum(c.agrees is False for c in report.checks)
