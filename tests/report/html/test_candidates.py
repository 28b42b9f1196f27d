"""The table of effects found and tried."""

from __future__ import annotations

from typing import Any

import pytest

from scara_ident.report.html.blocks import Folded, Table
from scara_ident.report.html.candidates import SHOWN_CANDIDATES, candidate_blocks


def row(name: str, gain: float, decision: str = "rejected") -> dict[str, Any]:
    return {"label": name, "why": f"why {name}", "gain": gain, "p_value": 0.2, "helps_in": (1, 3), "decision": decision}


def content(candidates: int) -> dict[str, Any]:
    found = {"effect": "spring", "joint": "joint2", "gain": 0.98, "p_value": 1e-9, "helps_in": (3, 3)}
    whole = {"effect": "base_tilt", "joint": None, "gain": 0.1, "p_value": 1e-4, "helps_in": (2, 3)}
    return {"effects": [found, whole], "candidates": [row(f"c{k}", 0.05 - 0.01 * k) for k in range(candidates)]}


def rows(content: dict[str, Any]) -> list[Any]:
    tables = [block.inside if isinstance(block, Folded) else block for block in candidate_blocks(content)]
    return [line for table in tables if isinstance(table, Table) for line in table.rows]


def test_the_effects_found_come_first_each_with_its_joint_and_verdict():
    lines = rows(content(3))
    assert [line[0].title for line in lines] == ["spring of joint2", "base_tilt", "c0", "c1", "c2"]
    assert [line[4].tag.text for line in lines] == ["found", "found", "rejected", "rejected", "rejected"]
    assert lines[2][0].note == "why c0"
    assert lines[1][3] == "2 of 3"


def test_bars_are_shares_of_the_largest_gain():
    lines = rows(content(3))
    assert lines[0][1].text == "98.0%"
    for line, gain in zip(lines, (0.98, 0.1, 0.05, 0.04, 0.03), strict=True):
        assert line[1].bar == pytest.approx(gain / 0.98)


@pytest.mark.parametrize("candidates", [0, SHOWN_CANDIDATES - 2, SHOWN_CANDIDATES - 1, 20])
def test_no_candidate_is_lost_and_those_beyond_the_first_unfold(candidates: int):
    blocks = candidate_blocks(content(candidates))
    more = max(0, candidates + 2 - SHOWN_CANDIDATES)
    folded = [block for block in blocks if isinstance(block, Folded)]
    assert [block.title for block in folded] == ([f"{more} more candidates"] if more else [])
    assert len(rows(content(candidates))) == candidates + 2


def test_a_gain_that_rounds_to_nothing_has_no_minus():
    (line,) = rows({"effects": [], "candidates": [row("c", -1e-5)]})
    assert line[1].text == "0.0%"


def test_without_anything_tried_the_table_is_empty():
    assert rows({"effects": [], "candidates": []}) == []
