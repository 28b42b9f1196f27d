"""Readings of the channels: one after another, and what is observed in them against recordings that are read so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.identification.channel_reading import (
    JointReading,
    as_mapped,
    has_zeros,
    observed_as,
    observed_exchanged,
    quarter_turns,
    turned,
    with_joint,
)
from scara_ident.recording.audit import Finding
from scara_ident.recording.recording import Recording
from tests.identification.turned_arm import arm, runs, seen


def test_turns_are_counted_from_a_quarter_back_to_a_half() -> None:
    assert [quarter_turns(k) for k in (-2, -1, 0, 1, 2, 3, 4)] == [2, -1, 0, 1, 2, -1, 0]


def test_one_reading_after_another_is_what_both_do() -> None:
    ways = [JointReading(e, p, k) for e in (1, -1) for p in (1, -1) for k in (0, 1, -1, 2)]
    for one in ways:
        for other in ways:
            both = one.then(other)
            at = other.position * (one.position * 30 + one.quarters * 90) + other.quarters * 90
            assert (both.position * 30 + both.quarters * 90 - at) % 360 == 0
            assert both.effort == one.effort * other.effort


def test_signals_of_opposite_sign() -> None:
    assert JointReading(1, 1, 2).signal is None
    assert has_zeros((JointReading(1, 1, 2),)) and not has_zeros(turned(3, "effort", 1))
    for signal in ("effort", "position", "effort and position"):
        assert turned(3, signal, 1)[1].signal == signal
        assert turned(3, signal, 1)[::2] == as_mapped(2)


def test_what_is_observed_is_of_recordings_that_are_read_so() -> None:
    robot = arm()
    items = runs(robot, (0,) * 4)
    reading = with_joint(turned(4, "effort", 0), 2, JointReading(-1, -1, 1))

    def read(item: Recording) -> Recording:
        assert item.effort is not None
        position = item.position.copy()
        position[2] = 0.5 * np.pi - position[2]
        return replace(item, position=position, effort=np.array([[-1.0], [1.0], [-1.0], [1.0]]) * item.effort)

    found, expected = observed_as(seen(robot, items), reading), seen(robot, [read(item) for item in items])
    for one, other in zip(found.joints, expected.joints, strict=True):
        # Of a filter that keeps what is constant to rounding; rows are taken at the same samples.
        assert np.max(np.abs(one.table - other.table)) < 1e-9 * np.max(np.abs(other.table))
    plain = observed_as(seen(robot, items), turned(4, "effort", 0))
    assert np.array_equal(plain.joints[1].table, seen(robot, items).joints[1].table)
    assert np.allclose(plain.joints[0].table[-1], -seen(robot, items).joints[0].table[-1], rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("signal", ["effort", "position", "effort and position"])
def test_exchanged_signals_are_those_of_exchanged_columns(signal: str) -> None:
    robot = arm()
    items = runs(robot, (0,) * 4)
    order = [0, 3, 2, 1]
    wrong = [replace(item, **{name: getattr(item, name)[order] for name in signal.split(" and ")}) for item in items]
    found = observed_exchanged(seen(robot, wrong), signal, (1, 3))
    for one, other in zip(found.joints, seen(robot, items).joints, strict=True):
        assert np.max(np.abs(one.table - other.table)) < 1e-9 * np.max(np.abs(other.table))


def test_a_joint_that_is_held_is_exchanged_with_its_positions() -> None:
    """Rows of the other joint were left out in its place, and nothing was left of a recording."""
    robot = arm()
    items = runs(robot, (0,) * 4)

    def held(joint: int, order: list[int]) -> list[Recording]:
        still = Finding("idle_joint", "", idle=(joint,))
        return [replace(item, position=item.position[order], findings=(still,)) for item in items]

    wrong, right = held(1, [0, 3, 2, 1]), held(3, [0, 1, 2, 3])
    found = observed_exchanged(seen(robot, wrong), "position", (1, 3))
    rows = [item.table.shape[1] for item in found.joints]
    assert rows == [item.table.shape[1] for item in seen(robot, right).joints]
    assert rows[3] == 0 < rows[1]
