"""What a model's columns carry, on columns whose answer is known."""

from __future__ import annotations

import numpy as np

from scara_ident.effects.spanned import Span, random_motion, rows_by_sample
from scara_ident.robot.robot import load_robot

RNG = np.random.default_rng(0)
ROWS = np.hstack([RNG.normal(size=(60, 3)), np.zeros((60, 1)), 1e6 * RNG.normal(size=(60, 1))])


def test_the_carriers_of_a_sum_are_its_parts():
    span = Span.of(ROWS)
    assert span.carriers(ROWS[:, [1]] - 3e-6 * ROWS[:, [4]]) == [1, 4]
    assert span.carriers(ROWS[:, [0]]) == [0]
    assert span.carriers(np.zeros((60, 2))) == []


def test_what_lies_outside_is_not_carried():
    span = Span.of(ROWS)
    noise = RNG.normal(size=(60, 1))
    assert span.carriers(noise) is None
    # A share of 1e-8 of the square is rounding of the robot's description.
    assert span.carriers(ROWS[:, [1]] + 1e-4 * noise) == [1]
    assert span.carriers(np.hstack([ROWS[:, [1]], noise])) is None


def test_rows_are_put_joint_by_joint():
    columns = RNG.normal(size=(2, 3, 5))
    rows = rows_by_sample(columns)
    assert rows.shape == (10, 3)
    assert np.array_equal(rows[5 + 2], columns[1, :, 2])


def test_random_states_are_repeated_by_the_generator():
    one, two = (random_motion(load_robot(), np.random.default_rng(3), 7) for _ in range(2))
    assert one.q.shape == (2, 7)
    assert np.array_equal(one.a, two.a)
    assert np.abs(one.q).max() <= np.pi
