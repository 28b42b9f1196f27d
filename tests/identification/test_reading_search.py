"""The search of readings: what each costs, and several joints of which none is better for itself."""

from __future__ import annotations

import pytest

from scara_ident.identification.channel_comparison import mean
from scara_ident.identification.channel_reading import JointReading, Reading, as_mapped, turned
from scara_ident.identification.few_rows import few_rows
from scara_ident.identification.reading_search import AXIS_COST, FACTOR_COST, ZERO_COST, cost, searched
from tests.identification.turned_arm import arm, runs, seen


def test_a_turned_axis_costs_less_than_two_signs() -> None:
    assert cost(as_mapped(3)) == 0
    assert cost(turned(3, "effort", 1)) == cost(turned(3, "position", 1)) == FACTOR_COST
    assert FACTOR_COST < cost(turned(3, "effort and position", 1)) == AXIS_COST < 2 * FACTOR_COST
    assert cost((JointReading(1, 1, 2), JointReading(-1, 1, 1))) == 2 * ZERO_COST + FACTOR_COST


@pytest.mark.slow
@pytest.mark.parametrize("quarters", [(0, -1, 1, 0), (0, 2, 1, 0)])
def test_zeros_of_two_joints_are_found_together(quarters: tuple[int, ...]) -> None:
    robot = arm()
    rows = few_rows(seen(robot, runs(robot, quarters)))
    tried = searched(rows)
    true: Reading = tuple(JointReading(1, 1, k) for k in quarters)
    assert tried[true] == pytest.approx(min(tried.values()), rel=0.02)
    assert tried[as_mapped(4)] > 5.0 * tried[true]
    assert all(left == pytest.approx(mean(rows.left(reading))) for reading, left in tried.items())
