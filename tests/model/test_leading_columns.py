"""The parameters that lead base parameters are those that enter the torque most, and the sums stay the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scara_ident.model.base_parameters import check_base_parameters, find_base_parameters
from scara_ident.model.leading_columns import HEAVIER, sums_of, with_heavier_leads
from scara_ident.robot.robot import load_robot
from tests.arms import Link, write_urdf

# The last axis of a URDF that a CAD program wrote, off z by 0.011 rad.
TILTED = (0.0110543260730592, -0.000656056606246875, 0.999938683852565)


@pytest.mark.parametrize("joints", [1, 3])
def test_an_axis_that_is_a_little_off_leaves_the_inertia_about_it_in_front(tmp_path: Path, joints: int):
    """It read Ixx + 8182 Izz, found as 16 ± 4 kg m^2 of a wrist of 0.002 kg m^2."""
    links = [Link(rpy=(1.57, 0.0, 0.0), xyz=(0.2, 0.0, 0.0)) for _ in range(joints - 1)] + [Link(axis=TILTED)]
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", links))
    base = find_base_parameters(robot)
    assert f"I{joints}zz" in base.names
    assert float(np.max(np.abs(base.grouping))) < HEAVIER
    assert check_base_parameters(robot, base).passed
    assert find_base_parameters(robot, seed=3).names == base.names


def test_the_sums_are_of_the_same_columns():
    random = np.random.default_rng(0)
    basis = random.standard_normal((20, 3))
    columns = basis @ np.array([[1e-4, 0.0, 0.0, 1.0, 2.0], [0.0, 1.0, 0.0, 0.3, 1.0], [0.0, 0.0, 1.0, 0.0, 0.5]])
    kept = with_heavier_leads(columns, [0, 1, 2], [3, 4])
    others = [k for k in range(5) if k not in kept]
    weights = sums_of(columns, kept, others)
    assert 0 not in kept
    assert np.max(np.abs(weights)) < HEAVIER
    np.testing.assert_allclose(columns[:, kept] @ weights, columns[:, others], atol=1e-12)


def test_of_two_that_weigh_as_much_the_first_leads():
    column = np.arange(1.0, 5.0)
    columns = np.column_stack([1e-4 * column, column, 1.001 * column])
    assert with_heavier_leads(columns, [0], [1, 2]) == [1]


def test_where_none_weighs_much_more_the_order_stays():
    columns = np.random.default_rng(1).standard_normal((20, 3)) @ np.array(
        [[1.0, 0.0, 4.0], [0.0, 1.0, -3.0], [0.0, 0.0, 0.0]]
    )
    assert with_heavier_leads(columns, [0, 1], [2]) == [0, 1]
    assert with_heavier_leads(columns, [0, 1], []) == [0, 1]
