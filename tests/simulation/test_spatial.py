"""The compiled recursion against Pinocchio."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from scara_ident.errors import RobotError
from scara_ident.robot.robot import load_robot
from scara_ident.simulation.spatial import TOLERANCE, check_against_pinocchio, configuration, mass_and_bias
from tests.arms import example_urdf
from tests.simulation.made import tree


def random_bodies(seed: int, n: int) -> np.ndarray:
    """Return standard parameters of random ellipsoids."""
    random = np.random.default_rng(seed)
    rows = []
    for _ in range(n):
        inertia = pin.Inertia.Random()
        inertia.mass = random.uniform(0.5, 5.0)
        inertia.lever = random.uniform(-0.3, 0.3, 3)
        rows.append(inertia.toDynamicParameters())
    return np.array(rows)


@pytest.mark.parametrize("name", ["ur5_robot.urdf", "panda.urdf"])
def test_compiled_dynamics_are_pinocchios_on_example_arms(name: str) -> None:
    robot = load_robot(example_urdf(name))
    assert check_against_pinocchio(robot.model, random_bodies(1, robot.n), states=50) <= TOLERANCE


def test_compiled_dynamics_are_pinocchios_on_a_branched_arm(tmp_path: Path) -> None:
    robot = tree(tmp_path)
    assert check_against_pinocchio(robot.model, random_bodies(2, robot.n), states=50) <= TOLERANCE


def test_forward_dynamics_are_pinocchios_aba(tmp_path: Path) -> None:
    robot = tree(tmp_path)
    bodies = random_bodies(3, robot.n)
    model = pin.Model(robot.model)
    for i, body in enumerate(bodies):
        model.inertias[i + 1] = pin.Inertia.FromDynamicParameters(body)
    data = model.createData()
    random = np.random.default_rng(4)
    for _ in range(10):
        q, v, torque = random.uniform(-2, 2, (3, robot.n))
        mass, bias = mass_and_bias(robot.model, bodies, q, v)
        expected = pin.aba(model, data, configuration(model, q), v, torque)
        np.testing.assert_allclose(np.linalg.solve(mass, torque - bias), expected, rtol=1e-9, atol=1e-9)


def test_a_body_that_pinocchio_sees_differently_is_refused() -> None:
    robot = load_robot(example_urdf("ur5_robot.urdf"))
    bodies = random_bodies(5, robot.n)
    bodies[2, 0] = np.nan
    with pytest.raises(RobotError, match="differ from Pinocchio"):
        check_against_pinocchio(robot.model, bodies)


@pytest.mark.parametrize("mass", [0.0, -7.7, 1e-9])
def test_a_body_that_cannot_exist_may_be_part_of_a_model(mass: float) -> None:
    """Bodies that follow from base parameters: their first moments count whatever their mass is."""
    robot = load_robot(example_urdf("ur5_robot.urdf"))
    bodies = random_bodies(6, robot.n)
    bodies[2] = [mass, 2.0, -3.0, 1.0, -0.1, 0.0, 0.2, 0.0, 0.0, 0.3]
    assert check_against_pinocchio(robot.model, bodies) <= TOLERANCE


def test_links_without_mass_are_refused_with_what_to_do() -> None:
    """A URDF without any <inertial>: 0 over 0 was said to differ from Pinocchio by nan."""
    robot = load_robot(example_urdf("ur5_robot.urdf"))
    with pytest.raises(RobotError, match="no joint moves a link with mass or inertia; give the links <inertial>"):
        check_against_pinocchio(robot.model, np.zeros((robot.n, 10)))
