"""How runs differ: the table holds the numbers of the JSON, and nothing is drawn where they do not."""

from __future__ import annotations

import numpy as np

from scara_ident.estimation.run_variation import JointVariation, RunVariation
from scara_ident.report.html.blocks import Cell, Folded, Table, number
from scara_ident.report.html.variation import variation_blocks
from scara_ident.robot.robot import load_robot

ROBOT = load_robot()


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
