"""Loss, elasticity and clearance of a gear against their equations."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.errors import UsageError
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import (
    Effect,
    SimulationResult,
    ideal,
    simulate,
    virtual_arm,
)
from scara_ident.simulation import effects as fx
from tests.arms import example_urdf, rnea, ur5
from tests.simulation.effects.runs import Array, assert_changes_by, load_at_motor, run
from tests.simulation.made import friction, scara, swing


def test_transmission_loss_takes_power_in_both_directions_of_its_flow() -> None:
    effect = fx.TransmissionLoss("joint2", 0.3)
    frictionless = replace(scara(), friction=np.zeros((2, 4)), rotor_inertia=np.array([0.0014, 0.0]))
    result = run(effect, frictionless)
    moving = result.true.direction[1] != 0.0
    given = (100.0 * result.true.effort[1] * result.true.velocity[1])[moving]
    passed = (load_at_motor(result)[1] * 100.0 * result.true.velocity[1])[moving]
    assert effect.efficiency == pytest.approx(math.sqrt(1.09) - 0.3)
    driving, driven = passed > 1e-3, passed < -1e-3
    assert driving.sum() > 300
    assert driven.sum() > 300
    np.testing.assert_allclose(passed[driving] / given[driving], effect.efficiency, rtol=1e-9)
    np.testing.assert_allclose(given[driven] / passed[driven], effect.efficiency, rtol=1e-9)


def test_a_spring_pulls_the_link_so_that_the_gear_loses_a_share_of_its_torque_too() -> None:
    frictionless = replace(scara(), friction=np.zeros((2, 4)), rotor_inertia=np.array([0.0014, 0.0]))
    effects = [fx.TransmissionLoss("joint2", 0.3), fx.Spring("joint2", 0.5, 0.2)]
    result = simulate(frictionless, swing(frictionless.robot, 3.0), effects=effects)
    passed = load_at_motor(result)[1] + 0.5 * (result.true.position[1] - 0.2)
    np.testing.assert_allclose(result.true.load[1] / 100.0, passed, atol=1e-9)
    moving = result.true.direction[1] != 0.0
    driving = moving & (passed * result.true.velocity[1] > 1e-3)
    assert driving.sum() > 300
    np.testing.assert_allclose(passed[driving] / result.true.effort[1, driving], effects[0].efficiency, rtol=1e-9)


def test_a_loaded_gear_with_loss_holds_what_it_could_not_lift() -> None:
    # One vertical link: between load x eta and load / eta the gear stands still.
    robot = load_robot(example_urdf("ur5_robot.urdf"))
    arm = replace(ideal(virtual_arm(robot)), friction=np.zeros((6, 4)))
    from scara_ident.simulation import free_motion

    pose = np.array([0.0, -0.6, 0.4, 0.1, 0.2, 0.0])
    load = rnea(robot, pose[:, None], np.zeros((6, 1)), np.zeros((6, 1)))[:, 0]
    effects = [fx.TransmissionLoss(joint, 0.2) for joint in robot.joints]
    for share, stands in ((1.1, True), (0.9, True), (1.3, False), (0.7, False)):
        _, true = free_motion(arm, pose, np.zeros(6), 0.05, torque=share * load, effects=effects)
        assert bool(np.all(true.velocity[1] == 0.0)) == stands


@pytest.mark.parametrize("effect", [fx.JointElasticity("joint2", 3000.0), fx.Backlash("joint2", 0.002, 30000.0)])
def test_an_elastic_joint_has_a_link_and_a_motor_of_its_own(effect: Effect) -> None:
    result = run(effect)
    arm, true = result.arm, result.true
    load = rnea(arm.robot, true.link_position, true.link_velocity, true.link_acceleration)
    np.testing.assert_allclose(true.load, load, atol=1e-9)
    rotor = (load + arm.armature[:, None] * true.acceleration) * arm.robot.row_scale[:, None]
    torque = rotor + friction(arm, true.velocity, true.direction)
    moving = true.direction != 0.0
    np.testing.assert_allclose(true.effort[moving], torque[moving], atol=1e-10)
    stretch = (true.position - true.link_position)[1]
    assert np.all(true.position[0] == true.link_position[0])
    if isinstance(effect, fx.JointElasticity):
        rate = (true.velocity - true.link_velocity)[1]
        link, rotor_inertia = arm.link_inertia()[1], arm.armature[1]
        reduced = link * rotor_inertia / (link + rotor_inertia)
        damping = 2.0 * effect.damping_ratio * np.sqrt(3000.0 * reduced)
        np.testing.assert_allclose(load[1], 3000.0 * stretch + damping * rate, atol=1e-9)
    else:
        free = np.abs(stretch) < 0.001
        assert free.sum() > 20
        assert np.abs(load[1, free]).max() < 1e-9
        assert np.all(load[1] * stretch >= -1e-9)
        assert np.abs(load[1, ~free]).max() > 1.0


@pytest.mark.parametrize(("name", "joints"), [("scara03", (0, 1)), ("ur5", (0, 1, 2))])
def test_several_elastic_joints_obey_the_equations_of_all_links_at_once(name: str, joints: tuple[int, ...]) -> None:
    arm = scara() if name == "scara03" else ideal(virtual_arm(load_robot(name)))
    effects = [fx.JointElasticity(arm.robot.joints[j], 4000.0) for j in joints]
    true = simulate(arm, swing(arm.robot, 1.0, amplitude=0.3), effects=effects).true
    # By Pinocchio, at the motion of the links.
    load = rnea(arm.robot, true.link_position, true.link_velocity, true.link_acceleration)
    np.testing.assert_allclose(true.load, load, atol=1e-9)
    for j, effect in zip(joints, effects, strict=True):
        reduced = 1.0 / (1.0 / arm.link_inertia()[j] + 1.0 / arm.armature[j])
        damping = 2.0 * effect.damping_ratio * np.sqrt(4000.0 * reduced)
        stretch, rate = (true.position - true.link_position)[j], (true.velocity - true.link_velocity)[j]
        np.testing.assert_allclose(load[j], 4000.0 * stretch + damping * rate, atol=1e-8)
    # And the motion is that of its own accelerations.
    for place, speed in ((true.link_position, true.link_velocity), (true.link_velocity, true.link_acceleration)):
        change = np.gradient(place, 1e-3, axis=1)[:, 5:-5]
        # Dry friction makes them jump.
        assert np.linalg.norm(change - speed[:, 5:-5]) < 0.02 * np.linalg.norm(speed)


def test_a_very_stiff_elastic_joint_is_a_rigid_one() -> None:
    plain = run(duration=1.0).true.position
    errors = [
        np.abs(run(fx.JointElasticity("joint1", k), duration=1.0).true.position - plain).max() for k in (1e5, 1e6, 1e7)
    ]
    assert errors[0] > errors[1] > errors[2]
    assert errors[2] < 2e-5


def test_an_elastic_joint_needs_a_rotor(tmp_path: Path) -> None:
    arm = replace(scara(), rotor_inertia=np.array([0.0, 4e-4]))
    with pytest.raises(UsageError, match="joint1 has no rotor inertia"):
        run(fx.JointElasticity("joint1", 1000.0), arm, 0.1)


EQUATIONS: dict[Effect, Callable[[SimulationResult], Array]] = {
    fx.TransmissionLoss("joint2", 0.2): lambda r: (
        (math.sqrt(1.04) - 1.0) * load_at_motor(r)[1] + 0.2 * abs(load_at_motor(r)[1]) * r.true.direction[1]
    ),
}


@pytest.mark.parametrize("effect", EQUATIONS, ids=lambda effect: effect.name)
def test_torque_changes_by_the_equation(effect: Effect) -> None:
    assert_changes_by(effect, EQUATIONS[effect])


@pytest.mark.parametrize("stiffness", [1500.0, 1e5])
@pytest.mark.parametrize(("name", "joint"), [("scara03", 0), ("ur5", 5), ("panda", 6)])
def test_steps_of_half_the_length_give_the_same_link(name: str, joint: int, stiffness: float) -> None:
    arm = scara() if name == "scara03" else ideal(virtual_arm(load_robot(name)))
    motion = swing(arm.robot, 0.15, amplitude=0.2)
    effects = [fx.JointElasticity(arm.robot.joints[joint], stiffness)]
    whole = simulate(arm, motion, effects=effects)
    half = simulate(arm, motion, effects=effects, substeps=2 * whole.substeps).true
    stretch = np.abs(half.position - half.link_position).max()
    assert np.abs(whole.true.link_position - half.link_position).max() < 1e-5 * stretch


@pytest.mark.parametrize("width", [0.0005, 0.005])
def test_clearance_is_gone_through_on_a_six_axis_arm(width: float) -> None:
    arm = ideal(virtual_arm(ur5()))
    names = arm.robot.joints[0], arm.robot.joints[3]
    result = simulate(arm, swing(arm.robot, 2.0, 0.3), effects=[fx.Backlash(name, width) for name in names])
    for j in (0, 3):
        stretch = (result.true.position - result.true.link_position)[j]
        assert np.abs(result.true.load[j, np.abs(stretch) < 0.5 * width]).max(initial=0.0) < 1e-9
        assert np.ptp(stretch) > width
