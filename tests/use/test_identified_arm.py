"""The virtual arm with given parameters takes the torque that the model predicts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from scara_ident.errors import RobotError
from scara_ident.model.model import build_model
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import Robot, load_robot
from scara_ident.simulation import virtual_arm
from scara_ident.simulation.inverse_dynamics import inverse_dynamics
from scara_ident.simulation.truth import _complete_parameters
from scara_ident.use.identified_arm import arm_with, arms_of, rotor_note, simulated
from tests.arms import Link, ur5, write_urdf
from tests.use.made import known_as


def moved_values(robot: Robot) -> dict[str, float]:
    """Parameters of the virtual arm, each off by some per cent, with all powers of friction and an offset."""
    model, random = build_model(robot, "complete"), np.random.default_rng(3)
    value = np.array(_complete_parameters(virtual_arm(robot)))
    value = value * (1.0 + 0.05 * random.normal(size=len(value)))
    value[[name.startswith("p_o") for name in model.names]] = 0.1
    return dict(zip(model.names, value, strict=True))


def lifted(folder: Path) -> Robot:
    """Two joints on a column that goes up and down: torque does not tell the column's offset from weight."""
    links = (Link(kind="prismatic", axis=(0, 0, 1)), Link(axis=(0, 1, 0), xyz=(0.1, 0, 0.2)), Link(xyz=(0.3, 0, 0)))
    write_urdf(folder / "arm.urdf", links)
    return load_robot(folder / "arm.urdf")


@pytest.mark.parametrize("name", ["scara03", "ur5", "lifted"])
def test_its_torque_is_the_models_on_any_motion(name: str, tmp_path: Path) -> None:
    robot = lifted(tmp_path) if name == "lifted" else load_robot(None if name == "scara03" else name)
    model, wanted = build_model(robot, "complete"), moved_values(robot)
    assert ("p_o1" in model.names) == (name != "lifted")
    arm = arm_with(robot, wanted)
    q, v, a = np.random.default_rng(1).normal(size=(3, robot.n, 40))
    motion = Motion("", "", np.arange(40.0), q, v, a, None, 1.0)
    predicted = np.einsum("npk,p->nk", model.regressor(motion), np.array(list(wanted.values())))
    torque = inverse_dynamics(arm, arm.bodies, q, v, a) / arm.scale[:, None]
    np.testing.assert_allclose(torque, predicted, rtol=1e-9, atol=1e-9 * np.abs(predicted).max())


def test_bodies_without_mass_take_the_models_torque_too() -> None:
    """Of base parameters bodies of less than no mass may follow, as on a large arm seen by small motion."""
    robot = ur5()
    model, wanted = build_model(robot, "complete"), moved_values(robot)
    lighter = virtual_arm(robot).bodies.copy()
    lighter[3, :4] = -40.0, 3.0, -2.0, 1.0
    near = np.concatenate([lighter.ravel(), virtual_arm(robot).armature])
    arm = arm_with(robot, wanted, near)
    assert arm.bodies[3, 0] < 0.0
    q, v, a = np.random.default_rng(1).normal(size=(3, robot.n, 40))
    motion = Motion("", "", np.arange(40.0), q, v, a, None, 1.0)
    predicted = np.einsum("npk,p->nk", model.regressor(motion), np.array(list(wanted.values())))
    torque = inverse_dynamics(arm, arm.bodies, q, v, a) / arm.scale[:, None]
    np.testing.assert_allclose(torque, predicted, rtol=1e-9, atol=1e-9 * np.abs(predicted).max())
    arm.draft()


def test_an_arm_that_an_estimate_has_found_is_taken_as_it_is() -> None:
    robot = ur5()
    arm, random = virtual_arm(robot), np.random.default_rng(4)
    found = np.concatenate([arm.bodies.ravel(), arm.armature]) * random.uniform(0.5, 1.5, 11 * robot.n)
    body = build_model(robot, "complete").rigid_body
    names = build_model(robot, "complete").names
    value = dict(zip(names, body.base.grouping[body.kept] @ found, strict=False))
    taken = arm_with(robot, value, found)
    # To rounding of the largest of its standard parameters.
    close = 1e-12 * np.abs(found).max()
    np.testing.assert_allclose(taken.bodies.ravel(), found[: 10 * robot.n], rtol=0.0, atol=close)
    np.testing.assert_allclose(taken.armature, found[10 * robot.n :], rtol=0.0, atol=close)


def test_a_rotor_below_zero_is_said_with_its_value_and_what_a_link_can_stand_in_for_is_not() -> None:
    robot = load_robot()
    model = build_model(robot, "complete")
    value = np.array(_complete_parameters(virtual_arm(robot)))
    below = value.copy()
    below[model.names.index("P_d5")] = -0.012
    assert "joint2 -0.012 kg m^2" in rotor_note(known_as(model, below))
    assert arms_of(known_as(model, below))[1].rotor_inertia[1] == 0.0
    # P_d1 has the rotor and the link: the link alone keeps the torque.
    value[model.names.index("P_d1")] = 1.5
    assert rotor_note(known_as(model, value)) == ""
    arm = arms_of(known_as(model, value))[1]
    found = np.array(_complete_parameters(arm))
    np.testing.assert_allclose(found, value, rtol=0.0, atol=1e-9 * np.abs(value).max())


def test_parameters_of_no_arm_are_refused() -> None:
    robot = load_robot()
    wanted = moved_values(robot) | {"P_d4": -50.0}
    with pytest.raises(RobotError, match="no arm with these parameters can move"):
        arm_with(robot, wanted)


def test_effects_of_a_diagnosis_become_those_of_the_virtual_arm() -> None:
    told = {"value": 0.2, "std": 0.01, "unit": "1"}
    found = [
        {"effect": "transmission_loss", "joint": "joint2", "parameters": {"loss_coefficient": told}},
        {"effect": "base_tilt", "joint": None, "parameters": {"tilt_x": told, "tilt_y": {"value": None, "std": None}}},
        {"effect": "drive_coupling", "joint": "joint2", "parameters": {"share": told}},
    ]
    pairs, missing = simulated(found)
    assert [(effect.name, effect.joint) for effect, _ in pairs] == [
        ("transmission_loss", "joint2"),
        ("base_tilt", None),
    ]
    assert [item for _, item in pairs] == found[:2]
    assert missing == ("drive_coupling",)


def test_a_rest_position_that_is_the_models_offset_counts_once() -> None:
    stiffness = {"value": 0.5, "std": 0.01}
    for std, rest in ((0.01, 0.2), (None, 0.0), (np.inf, 0.0)):
        told = {"stiffness": stiffness, "rest_position": {"value": 0.2, "std": std}}
        ((spring, _),), _ = simulated([{"effect": "spring", "joint": "joint1", "parameters": told}])
        assert spring.rest_position == rest
