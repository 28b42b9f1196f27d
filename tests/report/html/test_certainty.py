"""What is worth a look and whether what is left is noise: the tables hold the numbers of the JSON."""

from __future__ import annotations

from scara_ident.report.html.blocks import Cell, Table, chance
from scara_ident.report.html.certainty import evidence_blocks, limit_words, tentative_blocks

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
        ["joint2", "not shown", limit_words(None), "it is not white"],
    ]
