"""Bodies under another gravity, against Pinocchio."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.effects.gravity import first_moments, gravity_columns, gravity_torque, loaded_by_gravity, sideways
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import example_urdf, rnea
from tests.effects.scenes import moving
from tests.export.arms import ARMS


def test_gravity_from_the_side_is_that_of_pinocchio(tmp_path):
    robot = load_robot(example_urdf("ur5_robot.urdf"))
    item = moving(robot, 0.02)
    rest = np.zeros_like(item.q)
    moments = robot.standard_parameters()[first_moments(robot)]
    for axis in range(2):
        found = np.einsum("jkn,k->jn", gravity_columns(robot, axis, item.q), moments)
        tilted = load_robot(example_urdf("ur5_robot.urdf"))
        tilted.model.gravity.linear = -9.81 * np.eye(3)[axis]
        expected = rnea(tilted, item.q, rest, rest) * robot.row_scale[:, None]
        assert found == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("gravity", "names"),
    [((0, 0, -1), "xy"), ((0, -1, 0), "xz"), ((1, 0, 0), "yz"), ((0, 0, 0), "xy"), ((0.0, -0.42, -0.91), "xy")],
)
def test_directions_across_gravity_are_named_by_the_nearest_axes(gravity, names):
    robot = load_robot()
    model = robot.model.copy()
    model.gravity.linear = 9.81 * np.array(gravity, dtype=float)
    found = sideways(replace(robot, model=model))
    assert "".join(name for name, _ in found) == names
    across = np.array([direction for _, direction in found])
    assert across @ across.T == pytest.approx(np.eye(2))
    assert across @ np.array(gravity) == pytest.approx(np.zeros(2))
    assert all(direction["xyz".index(name)] > 0.9 for name, direction in found)


@pytest.mark.parametrize("make", ARMS, ids=lambda make: make.__name__)
def test_torque_under_any_gravity_is_that_of_pinocchio_and_its_slopes_are_its_derivatives(
    make: Callable[[Path], Robot], tmp_path: Path
) -> None:
    robot, rng = make(tmp_path), np.random.default_rng(5)
    q, gravity = rng.uniform(-3.0, 3.0, (robot.n, 7)), np.array([1.0, -2.0, 0.5])
    moments = robot.standard_parameters()[first_moments(robot)]
    leaning = make(tmp_path)
    leaning.model.gravity.linear = gravity
    rest = np.zeros_like(q)
    expected = rnea(leaning, q, rest, rest) * robot.row_scale[:, None]
    largest = np.abs(expected).max()
    assert gravity_torque(robot, q, gravity, moments) == pytest.approx(expected, abs=1e-12 * largest)
    for joint in range(robot.n):
        step = 1e-5 * (np.arange(robot.n) == joint)[:, None]
        ends = [gravity_torque(robot, q + side * step, gravity, moments) for side in (1.0, -1.0)]
        slope = gravity_torque(robot, q, gravity, moments, joint)
        assert slope == pytest.approx((ends[0] - ends[1]) / 2e-5, abs=1e-8 * largest)


def test_torque_of_some_moments_is_the_sum_of_their_columns() -> None:
    robot = load_robot(example_urdf("ur5_robot.urdf"))
    q, rng = moving(robot, 0.1).q, np.random.default_rng(2)
    moments = np.where(rng.uniform(size=4 * robot.n) < 0.5, rng.normal(size=4 * robot.n), 0.0)
    for axis, (_, direction) in enumerate(sideways(robot)):
        expected = np.einsum("jkn,k->jn", gravity_columns(robot, axis, q), moments)
        assert gravity_torque(robot, q, -9.81 * direction, moments) == pytest.approx(expected, abs=1e-9)


def test_gravity_loads_joints_whose_axis_is_not_upright() -> None:
    assert loaded_by_gravity(load_robot()) == (False, False)
    assert loaded_by_gravity(load_robot(example_urdf("ur5_robot.urdf"))) == (False, True, True, True, True, True)
