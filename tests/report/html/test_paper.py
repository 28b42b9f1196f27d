"""The page of the paper's checks."""

from __future__ import annotations

from scara_ident.paper import check_paper
from scara_ident.report.html.blocks import superscripts
from tests.report.html.document import document


def test_every_check_of_the_paper_stands_there_with_its_verdict(printed):
    report, found = check_paper(), document(printed)
    assert found.sections == [f"checks-{k}" for k in range(len(report.sections))]
    assert found.words.count("differs") >= sum(c.agrees is False for c in report.checks) > 0
    for check in report.checks:
        assert superscripts(check.quantity) in found.words
        assert superscripts(check.comment) in found.words
