"""Shares of work within work."""

from __future__ import annotations

import pytest

from scara_ident.progress import Work


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
