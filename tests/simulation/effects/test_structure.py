"""Tilt and payload against Pinocchio."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from scara_ident.errors import UsageError
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import VirtualArm, ideal, parse_effect, simulate, virtual_arm
from scara_ident.simulation import effects as fx
from tests.arms import ur5
from tests.simulation.effects.runs import Array, run
from tests.simulation.made import left_over, scara, swing


def with_gravity(arm: VirtualArm, extra: Array) -> VirtualArm:
    model = pin.Model(arm.robot.model)
    model.gravity.linear = model.gravity.linear + extra
    return replace(arm, robot=replace(arm.robot, model=model))


def test_base_tilt_is_gravity_along_the_base() -> None:
    result = run(fx.BaseTilt(tilt_x=0.03, tilt_y=-0.02))
    tilted = with_gravity(result.arm, -9.81 * np.array([0.03, -0.02, 0.0]))
    assert np.nanmax(np.abs(left_over(result.arm, result.true))) > 0.01
    assert np.nanmax(np.abs(left_over(tilted, result.true))) < 1e-10


def test_payload_acts_from_its_time_on() -> None:
    result = run(fx.PayloadChange(mass=4.0, time=1.5))
    model = pin.Model(result.arm.robot.model)
    point = np.array([0.33, 0.0, 0.0])
    model.inertias[2] = model.inertias[2] + pin.Inertia(4.0, point, np.zeros((3, 3)))
    loaded = replace(result.arm, robot=replace(result.arm.robot, model=model))
    late = result.recording.time >= 1.5
    for arm, part in ((result.arm, ~late), (loaded, late)):
        assert np.nanmax(np.abs(left_over(arm, result.true)[:, part])) < 1e-10
    assert np.nanmax(np.abs(left_over(result.arm, result.true)[:, late])) > 0.01


BOX = "mass=2.5,com=0.03/-0.02/0.08,inertia=0.02/0.001/-0.002/0.03/0.003/0.015"


def with_box(arm: VirtualArm) -> VirtualArm:
    """Return the arm with the box on its last body, in Pinocchio."""
    model = pin.Model(arm.robot.model)
    inertia = np.array([[0.02, 0.001, -0.002], [0.001, 0.03, 0.003], [-0.002, 0.003, 0.015]])
    model.inertias[model.njoints - 1] += pin.Inertia(2.5, np.array([0.03, -0.02, 0.08]), inertia)
    return replace(arm, robot=replace(arm.robot, model=model))


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_a_payload_is_a_part_of_the_last_body_while_it_is_carried(name: str) -> None:
    robot = load_robot(name)
    arm = ideal(virtual_arm(robot))
    motion = swing(robot, 0.6, amplitude=0.2)
    result = simulate(arm, motion, effects=[parse_effect(f"payload:{BOX},from=0.2,to=0.45")])
    time, size = result.recording.time, np.abs(result.true.effort).max()
    carried = (time >= 0.2 - 1e-9) & (time < 0.45 - 1e-9)
    for model, part in ((with_box(arm), carried), (arm, ~carried)):
        assert np.nanmax(np.abs(left_over(model, result.true)[:, part])) < 1e-9 * size
    assert np.nanmax(np.abs(left_over(arm, result.true)[:, carried])) > 0.02 * size


def test_a_run_that_starts_with_a_payload_starts_with_the_torque_that_holds_it() -> None:
    arm = ideal(virtual_arm(ur5()))
    motion = swing(arm.robot, 0.6, amplitude=0.2)
    plain, loaded = simulate(arm, motion), simulate(arm, motion, effects=[parse_effect(f"payload:{BOX}")])
    assert np.nanmax(np.abs(left_over(with_box(arm), loaded.true))) < 1e-9 * np.abs(loaded.true.effort).max()
    errors = [np.abs(each.true.position - motion.position)[:, :50].max() for each in (plain, loaded)]
    assert errors[1] < 2.0 * errors[0]
    assert loaded.effects[0].as_dict()["parameters"]["to"] is None


def test_payloads_add_up_and_two_halves_are_the_whole() -> None:
    arm = scara()
    motion = swing(arm.robot, 0.5)
    one = [parse_effect("payload:mass=3,from=0.1,to=0.3")]
    halves = [parse_effect(f"payload:mass=3,from={begin},to={end}") for begin, end in ((0.1, 0.2), (0.2, 0.3))]
    both = [parse_effect(f"payload:mass={mass},from=0.1,to=0.3") for mass in (1, 2)]
    runs = [simulate(arm, motion, effects=effects).true.effort for effects in (one, halves, both)]
    np.testing.assert_allclose(runs[1], runs[0], atol=1e-9)
    np.testing.assert_allclose(runs[2], runs[0], atol=1e-9)


def test_a_payload_that_comes_between_two_steps_is_as_exact_as_on_one() -> None:
    arm = scara()
    effect = parse_effect("payload:mass=5,from=0.10013,to=0.2")
    runs = [simulate(arm, swing(arm.robot, 0.3), effects=[effect], substeps=k).true.position for k in (4, 8, 64)]
    moved = np.abs(runs[2] - simulate(arm, swing(arm.robot, 0.3)).true.position).max()
    assert np.abs(runs[0] - runs[2]).max() < 1e-7 * moved
    assert np.abs(runs[1] - runs[2]).max() < 1e-7 * moved


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("payload:inertia=1/0/0/0/0/0", "no body has this inertia"),
        ("payload:inertia=1/2/0/1/0/1", "no body has this inertia"),
        ("payload:from=2,to=1", "ends at 1 s, before it begins at 2 s"),
        ("payload:mass=-1", "mass is -1"),
    ],
)
def test_a_payload_that_cannot_be_is_one_line(text: str, said: str) -> None:
    with pytest.raises(UsageError, match=said):
        simulate(scara(), swing(scara().robot, 0.1), effects=[parse_effect(text)])
