"""What words, numbers and tables look like as text."""

from __future__ import annotations

from scara_ident.report.summaries.words import in_units, number, table, text_of


def test_text_is_plain_and_keeps_brackets():
    rows = table("title [x]", "name", "value", right=("value",))
    rows.add_row("a", number(1.23456, 0.01))
    assert text_of("a sentence [b]", rows) == "a sentence [b]\ntitle [x]\nname  value\na     1.235\n"


def test_a_unit_is_said_once_for_all_that_have_it():
    assert in_units({"a": "N m", "b": "N m"}) == "N m"
    assert in_units({"a": "N m", "b": "N m", "z": "N"}) == "N m; z N"
