"""The table of errors before and after."""

from __future__ import annotations

from typing import Any

import pytest

from scara_ident.report.html.blocks import Cell, Table
from scara_ident.report.html.gain import gain_blocks
from scara_ident.robot.robot import load_robot


def content(effects: list[Any]) -> dict[str, Any]:
    part = {
        "before": {"joint1": 0.02, "joint2": 0.01},
        "after": {"joint1": 0.005, "joint2": 0.011},
        "before_relative": {"joint1": 0.1, "joint2": None},
        "after_relative": {"joint1": 0.025, "joint2": None},
    }
    run = {when: part[when] for when in ("before", "after")}
    return {
        "effects": effects,
        "training": part,
        "validation": {**part, "before": {}},
        "noise_floor": {"joint1": 0.004},
        "recordings": {"training": {"A_1": run}, "validation": {}},
    }


@pytest.mark.parametrize("effects", [["spring"], []])
def test_what_is_left_is_after_over_before_and_without_effects_there_is_one_error(effects):
    _, table, folded = gain_blocks(content(effects), load_robot())
    assert isinstance(table, Table)
    first = [cell.text if isinstance(cell, Cell) else cell for cell in table.rows[0]]
    if effects:
        assert first == ["training", "joint1", "0.0200", "0.00500", "25%", "10.0%", "2.5%", "0.00400", "N m"]
        assert [row[4].track for row in table.rows] == pytest.approx([0.25, 1.1])
    else:
        assert first == ["training", "joint1", "0.0200", "10.0%", "0.00400", "N m"]
        assert "after" not in " ".join((*table.head, *folded.inside.head))
    assert len(table.head) == len(table.rows[0])
    assert len(folded.inside.head) == len(folded.inside.rows[0])
