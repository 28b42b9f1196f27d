"""The URDF's values of a model's parameters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.model.model import build_model
from scara_ident.model.urdf_values import urdf_values
from scara_ident.robot.robot import load_robot


def test_the_scaras_are_those_that_its_urdf_is_made_of():
    robot = load_robot()
    model = build_model(robot, "reduced")
    stated = dict(zip(model.names, urdf_values(model), strict=True))
    base = model.rigid_body.base
    whole = base.grouping @ robot.standard_parameters()
    # The reduced model is without P_d3.
    assert [name for name, value in stated.items() if np.isfinite(value)] == ["P_d1", "P_d2", "P_d4", "P_d5"]
    np.testing.assert_array_equal([stated[name] for name in ("P_d1", "P_d2", "P_d4", "P_d5")], whole[[0, 1, 3, 4]])


def test_a_sum_with_a_rotor_that_nobody_stated_has_none():
    silent = replace(load_robot(), rotor_stated=np.array([True, False]))
    stated = dict(zip(*((model := build_model(silent, "reduced")).names, urdf_values(model)), strict=True))
    assert np.isnan(stated["P_d5"])
    assert np.isfinite(stated["P_d1"])


def test_right_angles_of_few_digits_put_no_rotor_into_sums_that_are_without_it():
    model = build_model(load_robot("xarm7"), "basic")
    stated = dict(zip(model.names, urdf_values(model), strict=True))
    rotors = {"I1zz", "I2zz", *(f"Ia{k}" for k in range(3, 8))}
    bodies = {column.name for column in model.rigid_body.columns}
    assert {name for name in bodies if np.isnan(stated[name])} == rotors
