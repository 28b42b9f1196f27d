"""The report of a model in use."""

from __future__ import annotations


def test_the_page_has_the_table_and_leaves_out_what_is_not_there(used_page) -> None:
    page = used_page.read_text(encoding="utf-8")
    assert "with the effects found" in page
    assert "In simulation" in page
