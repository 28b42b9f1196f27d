"""The report of a model in use."""

from __future__ import annotations

from pathlib import Path

from scara_ident.report.html.use import use_report
from tests.report.test_use import result


def test_the_page_has_the_table_and_leaves_out_what_is_not_there(tmp_path: Path) -> None:
    use_report(tmp_path / "report.html", result())
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "with the effects found" in page
    assert "In simulation" in page
