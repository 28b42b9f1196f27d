"""Few samples say of a reading what all rows say of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.estimation.observations import observe
from scara_ident.identification.channel_comparison import held_out
from scara_ident.identification.channel_reading import JointReading, as_mapped, observed_as, turned, with_joint
from scara_ident.identification.few_rows import few_rows
from scara_ident.motion.low_pass import low_pass
from tests.identification.turned_arm import arm, runs, seen


def test_they_leave_what_all_rows_leave() -> None:
    robot = arm()
    held = seen(robot, runs(robot, (0, 1, 0, 0)))
    rows = few_rows(held)
    assert rows.q.shape[1] < 0.5 * sum(part.samples for part in held.data.stretches)
    mended = with_joint(as_mapped(4), 1, JointReading(1, 1, 1))
    _, expected = held_out(observed_as(held, mended))
    # Of other samples, fitted to and not held out; columns that are not filtered leave a few thousandths.
    assert np.all(np.abs(rows.left(mended) - expected) < 0.003 + 0.3 * expected)
    for reading in (as_mapped(4), turned(4, "effort", 1), turned(4, "effort and position", 2)):
        # A wrong reading is fitted to its samples, and worse where it was not.
        ratio = rows.left(reading) / held_out(observed_as(held, reading))[1]
        assert np.all((ratio > 0.4) & (ratio < 1.2))


def test_those_asked_for_at_once_are_those_asked_for_alone() -> None:
    robot = arm()
    held = seen(robot, runs(robot, (0, 1, 0, 0)))
    together, alone = few_rows(held), few_rows(held)
    readings = [turned(4, "effort", k) for k in range(4)] + [turned(4, "position", 1)]
    together.leave(readings)
    for reading in readings:
        assert np.array_equal(together.left(reading), alone.left(reading))


def test_exchanged_samples_are_those_of_exchanged_recordings() -> None:
    robot = arm()
    items = runs(robot, (0,) * 4)
    order = [0, 3, 2, 1]
    wrong = [replace(item, position=item.position[order], effort=item.effort[order]) for item in items]
    found = few_rows(seen(robot, wrong)).exchanged("effort and position", (1, 3))
    right = few_rows(seen(robot, items))
    assert np.allclose(found.q, right.q) and np.allclose(found.torque, right.torque)
    # Where a joint counts is that of its own column, whose rests are those of the other.
    assert found.left(as_mapped(4)).max() < 0.1


def test_one_band_for_all_is_the_narrowest_or_the_widest() -> None:
    """A joint whose own was left too narrow hides all others in it."""
    robot = arm()
    held = seen(robot, runs(robot, (0,) * 4))
    held = observe(held.model, held.data.at((5.0, 1.0, 5.0, 5.0)))
    part = held.data.stretches[0]
    for widest, band in ((False, 1.0), (True, 5.0)):
        first = few_rows(held, widest=widest).torque[:, 0]
        assert np.allclose(first, low_pass(part.torque, part.rate, band)[:, part.trim])
