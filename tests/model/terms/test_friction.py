"""Friction and offset: each column on its own joint's row, in the motor's direction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.effects.spanned import random_motion
from scara_ident.model.base_parameters import constant_torques
from scara_ident.model.model import TorqueModel, build_model
from scara_ident.model.terms import Friction, Offset
from scara_ident.model.terms.friction import offset
from scara_ident.model.terms.rigid_body import rigid_body
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import Link, motion, ur5, write_urdf
from tests.excitation.made import scara_with_quill

LINKS = (Link(), Link(kind="prismatic", axis=(1, 0, 0), xyz=(0.1, 0, 0)), Link(axis=(0, 1, 0)))


@pytest.fixture
def robot(tmp_path: Path) -> Robot:
    return load_robot(write_urdf(tmp_path / "arm.urdf", LINKS))


def made(n: int = 3):
    rng = np.random.default_rng(0)
    v = rng.uniform(-2, 2, (n, 40))
    v[:, 7] = 0.0
    return motion(rng.standard_normal((n, 40)), v, rng.standard_normal((n, 40)))


def test_columns_are_powers_of_the_joints_own_speed(robot: Robot):
    term, moved = Friction(robot), made()
    found = term.regressor(moved)
    assert found.shape == (3, 12, 40)
    for joint in range(3):
        v = moved.v[joint]
        expected = [np.sign(v), v, np.sign(v) * v**2, v**3]
        np.testing.assert_allclose(found[joint, 4 * joint : 4 * joint + 4], expected, atol=1e-14)
        others = [k for k in range(12) if k // 4 != joint]
        assert not found[joint, others].any()


def test_columns_are_named_by_power_and_joint(robot: Robot):
    assert [column.name for column in Friction(robot, (0, 1, 2)).columns] == [
        f"a{power}{joint}" for joint in (1, 2, 3) for power in (0, 1, 2)
    ]
    assert [column.joint for column in Friction(robot).columns] == [f"j{k}" for k in (1, 2, 3) for _ in range(4)]


def test_every_model_of_friction_dissipates_with_nonnegative_coefficients(robot: Robot):
    moved = made()
    for powers in ((0,), (0, 1), (0, 1, 2), (0, 1, 2, 3)):
        term = Friction(robot, powers)
        torque = np.einsum("jpk,p->jk", term.regressor(moved), np.ones(len(term.columns)))
        assert np.all(torque * moved.v >= 0.0)


def test_units_go_with_the_kind_of_joint_and_the_side(robot: Robot):
    units = [column.unit for column in Friction(robot).columns]
    assert units[:4] == ["N m", "N m s/rad", "N m s^2/rad^2", "N m s^3/rad^3"]
    assert units[4:8] == ["N", "N s/m", "N s^2/m^2", "N s^3/m^3"]
    motor = replace(robot, effort_side="motor")
    assert [column.unit for column in Friction(motor).columns][4:6] == ["N m", "N m s/m"]
    assert [column.unit for column in Offset(robot).columns] == ["N m", "N", "N m"]


def test_where_the_gear_reverses_friction_keeps_its_sign_at_the_motor(robot: Robot):
    moved = made()
    gears = np.array([-100.0, 50.0, -3.0])
    motor = replace(robot, effort_side="motor", reduction=gears)
    found = Friction(motor).regressor(moved)
    plain = Friction(robot).regressor(moved)
    for joint in range(3):
        own = slice(4 * joint, 4 * joint + 4)
        np.testing.assert_allclose(found[joint, own], np.sign(gears[joint]) * plain[joint, own], atol=1e-14)


def test_at_the_joint_the_gears_direction_does_not_matter(robot: Robot):
    moved = made()
    reversed_ = replace(robot, reduction=np.array([-100.0, -1.0, -5.0]))
    np.testing.assert_array_equal(Friction(reversed_).regressor(moved), Friction(robot).regressor(moved))


def test_at_no_speed_there_is_no_friction(robot: Robot):
    assert not Friction(robot).regressor(made())[:, :, 7].any()


def test_coulomb_friction_cannot_be_negative_and_higher_powers_may(robot: Robot):
    assert [column.nonnegative for column in Friction(robot).columns[:4]] == [True, False, False, False]
    assert [column.nonnegative for column in Friction(robot, (0, 1)).columns[:2]] == [True, True]
    assert not any(column.nonnegative for column in Offset(robot).columns)


def test_the_offset_is_one_on_its_joint(robot: Robot):
    term = Offset(robot)
    np.testing.assert_array_equal(term.regressor(made()), np.repeat(np.eye(3)[:, :, None], 40, axis=2))
    assert [column.name for column in term.columns] == ["p_o1", "p_o2", "p_o3"]


def test_patterns_are_where_entries_are(robot: Robot):
    for term in (Friction(robot), Friction(robot, (0, 1)), Offset(robot)):
        np.testing.assert_array_equal(np.any(term.regressor(made()) != 0.0, axis=2), term.pattern)


def test_an_axis_that_goes_up_and_down_has_no_offset_of_its_own(robot: Robot):
    """Its weight is a constant torque as well: mass, inertia and offset of a SCARA's arm were all undetermined for it."""
    quill = scara_with_quill()
    assert constant_torques(quill) == (2,)
    term = offset(quill)
    assert [column.name for column in term.columns] == ["p_o1", "p_o2"]
    assert [column.joint for column in term.columns] == list(quill.joints[:2])
    moved = random_motion(quill, np.random.default_rng(1), 200)
    rows = term.regressor(moved)
    assert rows.shape == (3, 2, 200)
    np.testing.assert_array_equal(np.any(rows != 0.0, axis=2), term.pattern)
    np.testing.assert_array_equal(term.of_joints(np.array([0.2, -0.1])), [0.2, -0.1, 0.0])
    np.testing.assert_array_equal(term.state_torque(np.array([0.2, -0.1]))(*np.zeros((3, 3))), [0.2, -0.1, 0.0])
    (note,) = term.notes()
    assert note.startswith(f"{quill.joints[2]}: it always carries the same weight")
    # Every parameter is told by motion; with an offset of that joint six of them are not.
    for model, missing in ((build_model(quill), 0), (whole_model(quill), 1)):
        columns = model.regressor(moved).transpose(2, 0, 1).reshape(600, -1)
        rank = np.linalg.matrix_rank(columns / np.linalg.norm(columns, axis=0), tol=1e-8 * np.sqrt(600))
        assert len(model.names) - rank == missing
    # Across gravity, or without any, or turning, an axis has one.
    for gravity in ((0.0, -9.81, 0.0), (0.0, 0.0, 0.0)):
        assert constant_torques(scara_with_quill(gravity)) == ()
    assert constant_torques(load_robot()) == constant_torques(ur5()) == ()


def whole_model(robot: Robot) -> TorqueModel:
    return TorqueModel("complete", robot, (rigid_body(robot), Friction(robot), Offset(robot)))
