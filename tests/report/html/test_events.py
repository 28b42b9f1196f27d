"""Events in a report: a row each with what the JSON says of it, and no table without."""

from __future__ import annotations

from scara_ident.identification.events import Event
from scara_ident.report.html.blocks import Cell, Table
from scara_ident.report.html.events import events_blocks
from scara_ident.robot.robot import load_robot

ROBOT = load_robot()
PUSH = Event("run_3", 4.2, 5.1, ("joint1", "joint2"), 6.1, "contact", 3.0, force=(3.0, 4.0, 0.0))
LOADED = Event("run_9", 0.0, 20.0, ("joint2",), 25.0, "other payload", held_out=True)


def test_each_event_has_its_row():
    _, table = events_blocks(ROBOT, (PUSH, LOADED))
    assert isinstance(table, Table)
    shown = [[cell.text if isinstance(cell, Cell) else cell for cell in row] for row in table.rows]
    assert shown[0][:4] == ["run_3", "4.20", "5.10", "joint1, joint2"]
    assert shown[0][5:] == ["contact", "5 N", "left out of the fit"]
    assert shown[1][5:] == ["other payload", "–", "held out"]


def test_without_events_nothing_is_shown():
    assert events_blocks(ROBOT, ()) == []
