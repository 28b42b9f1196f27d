"""Shares of work within work."""

from __future__ import annotations

import logging

import pytest

from scara_ident import identify
from scara_ident.progress import Work
from tests.results import Results


def test_a_part_of_a_part_tells_the_share_of_the_whole():
    told: list[tuple[str, float]] = []
    work = Work(lambda step, done: told.append((step, done)))
    work("first")
    part = work.part(0.5, 0.9)
    part("second", 0.25)
    part.part(0.5, 1.0)("third", 1.0)
    assert [step for step, _ in told] == ["first", "second", "third"]
    assert [done for _, done in told] == pytest.approx([0.0, 0.6, 0.9])


def test_nobody_need_listen():
    Work()("first", 0.5)


def test_notes_go_to_the_modules_logger_and_nowhere_else(results: Results, caplog, capfd):
    found = identify(
        results.robot, [results.runs[0].recording], validation=[results.runs[2].recording], bands=[2.0, 2.0]
    )
    assert found.notes
    mine = [record for record in caplog.records if record.name == "scara_ident.identification.identify"]
    assert [record.getMessage() for record in mine] == list(found.notes)
    assert {record.levelname for record in mine} == {"WARNING"}
    assert capfd.readouterr() == ("", "")
    assert any(isinstance(handler, logging.NullHandler) for handler in logging.getLogger("scara_ident").handlers)
