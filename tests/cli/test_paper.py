"""``scara-ident paper``: the checks as tables, and the files beside them."""

from __future__ import annotations

import json
from pathlib import Path

from scara_ident.paper import check_paper


def test_it_prints_how_many_agree_and_everything_that_differs(command, tmp_path: Path):
    report = check_paper()
    result = command("paper")
    assert result.status == 0
    said = " ".join(result.out.split())
    for section in report.sections:
        checks = report.section(section)
        agreeing, judged = sum(c.agrees is True for c in checks), sum(c.agrees is not None for c in checks)
        assert f"{section}: {agreeing} of {judged} agree" in said
    assert result.out.count("differs") >= sum(c.agrees is False for c in report.checks) > 0


def test_the_file_holds_the_whole_report(command, tmp_path: Path):
    result = command("paper", "--output", tmp_path / "out")
    assert result.status == 0
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"paper.json", "report.html"}
    assert json.loads((tmp_path / "out" / "paper.json").read_text()) == check_paper().to_dict()
    assert f"written: {tmp_path / 'out' / 'paper.json'}" in result.out
