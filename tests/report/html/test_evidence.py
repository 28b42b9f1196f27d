"""The sections that a result rests on: their tables hold the numbers of the JSON, and none stands where there is nothing to say."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from scara_ident.estimation.run_variation import JointVariation, RunVariation
from scara_ident.identification.events import Event
from scara_ident.report.html.blocks import Cell, Folded, Table, chance, number
from scara_ident.report.html.evidence import (
    SHOWN_CANDIDATES,
    candidate_blocks,
    events_blocks,
    evidence_blocks,
    gain_blocks,
    share_words,
    tentative_blocks,
    variation_blocks,
)
from scara_ident.robot.robot import load_robot

ROBOT = load_robot()


def errors(effects: list[Any]) -> dict[str, Any]:
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
        "left_out": {"training": {"joint1": 0.11, "joint2": 0.23}, "validation": {}},
        "recordings": {"training": {"A_1": run}, "validation": {}},
    }


@pytest.mark.parametrize("effects", [["spring"], []])
def test_what_is_left_is_after_over_before_and_without_effects_there_is_one_error(effects):
    said, table, folded = gain_blocks(errors(effects), ROBOT)
    assert "11 to 23 % of the time, at rest, at reversals" in said.text
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


def test_beside_offsets_that_differ_errors_are_reported_without_them_too():
    """What an effect leaves could not be seen beside the offsets: 99 % of it."""
    content = errors(["spring"])
    content["training"]["before_own_offset"] = {"joint1": 0.01, "joint2": 0.01}
    content["training"]["after_own_offset"] = {"joint1": 0.001, "joint2": 0.01}
    said, table, _ = gain_blocks(content, ROBOT)
    texts = [[cell.text if isinstance(cell, Cell) else cell for cell in row] for row in table.rows]
    assert texts[2] == ["training, own offsets", "joint1", "0.0100", "0.00100", "10%", "", "", "0.00400", "N m"]
    assert "own offsets" in said.text
    assert all(len(row) == len(table.head) for row in table.rows)


def row(name: str, gain: float, decision: str = "rejected") -> dict[str, Any]:
    return {"label": name, "why": f"why {name}", "gain": gain, "p_value": 0.2, "helps_in": (1, 3), "decision": decision}


def ranked(candidates: int) -> dict[str, Any]:
    found = {"effect": "spring", "joint": "joint2", "gain": 0.98, "p_value": 1e-9, "helps_in": (3, 3)}
    whole = {"effect": "base_tilt", "joint": None, "gain": 0.1, "p_value": 1e-4, "helps_in": (2, 3)}
    return {"effects": [found, whole], "candidates": [row(f"c{k}", 0.05 - 0.01 * k) for k in range(candidates)]}


def rows(content: dict[str, Any]) -> list[Any]:
    tables = [block.inside if isinstance(block, Folded) else block for block in candidate_blocks(content)]
    return [line for table in tables if isinstance(table, Table) for line in table.rows]


def test_the_effects_found_come_first_each_with_its_joint_and_verdict():
    lines = rows(ranked(3))
    assert [line[0].title for line in lines] == ["spring of joint2", "base_tilt", "c0", "c1", "c2"]
    assert [line[4].tag.text for line in lines] == ["found", "found", "rejected", "rejected", "rejected"]
    assert lines[2][0].note == "why c0"
    assert lines[1][3] == "2 of 3"


def test_bars_are_shares_of_the_largest_gain():
    lines = rows(ranked(3))
    assert lines[0][1].text == "98.0%"
    for line, gain in zip(lines, (0.98, 0.1, 0.05, 0.04, 0.03), strict=True):
        assert line[1].bar == pytest.approx(gain / 0.98)


@pytest.mark.parametrize("candidates", [0, SHOWN_CANDIDATES - 2, SHOWN_CANDIDATES - 1, 20])
def test_no_candidate_is_lost_and_those_beyond_the_first_unfold(candidates: int):
    blocks = candidate_blocks(ranked(candidates))
    more = max(0, candidates + 2 - SHOWN_CANDIDATES)
    folded = [block for block in blocks if isinstance(block, Folded)]
    assert [block.title for block in folded] == ([f"{more} more candidates"] if more else [])
    assert len(rows(ranked(candidates))) == candidates + 2


def test_a_gain_that_rounds_to_nothing_has_no_minus():
    (line,) = rows({"effects": [], "candidates": [row("c", -1e-5)]})
    assert line[1].text == "0.0%"


def test_without_anything_tried_the_table_is_empty():
    assert rows({"effects": [], "candidates": []}) == []


CONTENT = {
    "tentative": [
        {"effect": "presliding", "joint": "joint2", "description": "d", "why": "helps in only 2 of 3", "settled_by": "reverse", "gain": 0.0714, "p_value": 2e-4},
        {"effect": "base_tilt", "joint": None, "description": "d", "why": "runs differ", "settled_by": "level", "gain": 0.06, "p_value": 0.5},
    ],
    "evidence": {
        "joint1": {"noise": True, "by": "repetition", "why": "repetitions leave little", "detection_limit": 0.0123},
        "joint2": {"noise": False, "by": "", "why": "it is not white", "detection_limit": None},
    },
}  # fmt: skip


def words(table: Table) -> list[list[str]]:
    return [
        [(cell.tag.text if cell.tag else cell.text) if isinstance(cell, Cell) else cell for cell in row]
        for row in table.rows
    ]


def test_what_is_worth_a_look_stands_with_its_numbers_and_what_would_settle_it():
    _, table = tentative_blocks(CONTENT)
    assert isinstance(table, Table)
    assert words(table) == [
        ["presliding on joint2", "7.1%", chance(2e-4), "helps in only 2 of 3", "reverse"],
        ["base_tilt", "6.0%", chance(0.5), "runs differ", "level"],
    ]
    assert tentative_blocks({"tentative": []}) == []


def test_every_joint_says_by_what_it_was_shown_to_be_noise_and_what_would_not_have_been_seen():
    _, table = evidence_blocks(CONTENT)
    assert isinstance(table, Table)
    assert words(table) == [
        ["joint1", "noise, by repetition", "1.2%", "repetitions leave little"],
        ["joint2", "not shown", share_words(None), "it is not white"],
    ]


PUSH = Event("run_3", 4.2, 5.1, ("joint1", "joint2"), 6.1, "contact", 3.0, force=(3.0, 4.0, 0.0))
LOADED = Event("run_9", 0.0, 20.0, ("joint2",), 25.0, "other payload", held_out=True)


def test_each_event_has_its_row():
    _, table = events_blocks(ROBOT, (PUSH, LOADED))
    assert isinstance(table, Table)
    shown = [[cell.text if isinstance(cell, Cell) else cell for cell in row] for row in table.rows]
    assert shown[0][:4] == ["run_3", "4.20", "5.10", "joint1, joint2"]
    assert shown[0][5:] == ["contact", "5 N", "left out of the fit"]
    assert shown[1][5:] == ["other payload", "–", "held out"]
    _, table = events_blocks(ROBOT, (replace(PUSH, sizes=(6.1, 7.2)),))
    assert list(table.rows[0][3:5]) == ["joint2, joint1", "7.20 N m, 6.10 N m"]


def test_without_events_nothing_is_shown():
    assert events_blocks(ROBOT, ()) == []


def differing() -> RunVariation:
    """Friction of joint 2 by 6 % and its offset by 0.02 N m in three runs."""
    std = np.array([0.06, 0.0, 0.02, 0.0])
    of_run = np.outer([1.0, -1.0, 0.5], std)
    item = JointVariation(np.ones((4, 9)), std, of_run, 0.01, np.array([0, 3, 6, 9]), 0.0 * of_run)
    return RunVariation((None, item))


def text(cell: Cell | str) -> str:
    return cell.text if isinstance(cell, Cell) else cell


def test_each_joint_and_kind_that_differs_has_its_row():
    variation = differing()
    _, table, folded = variation_blocks(ROBOT, variation, ["A_1", "A_2", "B_1"])
    assert isinstance(table, Table)
    sizes = variation.sizes(ROBOT)["joint2"]
    assert [[text(cell) for cell in row] for row in table.rows] == [
        ["joint2", "friction", number(100.0 * sizes["friction"]), "%"],
        ["joint2", "offset", number(sizes["offset"]), "N m"],
    ]
    assert isinstance(folded, Folded)
    assert isinstance(folded.inside, Table)
    assert folded.inside.head == ["joint", "what differs", "A_1", "A_2", "B_1", "unit"]
    assert [text(cell) for cell in folded.inside.rows[0]] == ["joint2", "friction", "6.00", "-6.00", "3.00", "%"]


def test_where_runs_do_not_differ_nothing_is_drawn():
    assert variation_blocks(ROBOT, None, ["A_1"]) == []
    assert variation_blocks(ROBOT, RunVariation((None, None)), ["A_1"]) == []
