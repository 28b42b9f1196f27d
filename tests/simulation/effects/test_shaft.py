"""A shaft between two joints against its equation and its energy."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.errors import UsageError
from scara_ident.simulation import effects as fx
from scara_ident.simulation import free_motion, ideal, on_side, parse_effect, simulate, virtual_arm
from tests.arms import ur5
from tests.simulation.made import bare, left_over, scara, swing
from tests.simulation.test_integrate import energy


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_it_loads_both_joints_by_its_equation_and_no_other(sign: float) -> None:
    arm = ideal(virtual_arm(ur5()))
    effect = parse_effect(f"coupled_shaft:inertia=0.08,viscous=0.6,coulomb=0.7,sign={sign:g}").resolve(arm)
    assert (effect.joint, effect.other(arm)) == ("wrist_2_joint", "wrist_3_joint")
    true = simulate(arm, swing(arm.robot, 1.5, amplitude=0.3), effects=[effect]).true
    way, speed, change = (x[4] + sign * x[5] for x in (true.position, true.velocity, true.acceleration))
    # After a reversal dry friction needs some of its short way.
    last = np.maximum.accumulate(np.where(np.diff(np.sign(speed), prepend=0.0) != 0.0, np.arange(len(way)), 0))
    settled = np.abs(way - way[last]) > 2e-3
    assert settled.mean() > 0.3
    torque = 0.08 * change + 0.6 * speed + 0.7 * np.sign(speed)
    extra = left_over(arm, true)
    for joint, side in ((4, 1.0), (5, sign)):
        moving = settled & np.isfinite(extra[joint])
        np.testing.assert_allclose(extra[joint, moving], side * torque[moving], atol=1e-7)
    assert np.nanmax(np.abs(extra[:4])) < 1e-9 * np.abs(true.effort).max()


def test_it_is_at_the_joint_whatever_side_is_recorded() -> None:
    effect = parse_effect("coupled_shaft:inertia=2,viscous=1,coulomb=3")
    motor, joint = (
        simulate(on_side(scara(), side), swing(scara().robot, 0.5), effects=[effect]).true
        for side in ("motor", "joint")
    )
    np.testing.assert_allclose(motor.position, joint.position, atol=1e-12)


def test_without_friction_energy_is_conserved_with_that_of_the_shaft() -> None:
    arm = bare(scara())
    shaft = fx.CoupledShaft(inertia=3.0, viscous=0.0, coulomb=0.0, sign=-1.0)
    _, true = free_motion(arm, np.array([0.3, 0.5]), np.array([2.0, -1.0]), 4.0, effects=[shaft])
    every = slice(None, None, 50)
    total = energy(arm, true.position[:, every], true.velocity[:, every])
    total += 0.5 * 3.0 * (true.velocity[0] - true.velocity[1])[every] ** 2
    assert np.ptp(true.velocity[0]) > 0.1
    assert np.abs(total - total[0]).max() < 1e-6 * total[0]


def test_its_friction_takes_what_the_arm_loses() -> None:
    arm = bare(scara())
    shaft = fx.CoupledShaft(inertia=3.0, viscous=2.0, coulomb=1.5)
    time, true = free_motion(arm, np.array([0.3, 0.5]), np.array([2.0, -1.0]), 2.0, effects=[shaft])
    speed = true.velocity[0] + true.velocity[1]
    total = energy(arm, true.position, true.velocity) + 0.5 * 3.0 * speed**2
    power = 2.0 * speed**2 + 1.5 * np.abs(speed)
    lost = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1]) * np.diff(time))])
    assert lost[-1] > 0.02 * total[0]
    # The way over which dry friction grows and turns is missing from its work: 1.5 N m over a few 0.1 mrad.
    np.testing.assert_allclose(total[0] - total, lost, atol=2e-3)


def test_steps_of_half_the_length_give_the_same_motion() -> None:
    arm = ideal(virtual_arm(ur5()))
    effect = parse_effect("coupled_shaft:inertia=0.08,viscous=0.6,coulomb=2")
    runs = [simulate(arm, swing(arm.robot, 0.8, 0.2), effects=[effect], substeps=k).true.position for k in (4, 8, 64)]
    plain = simulate(arm, swing(arm.robot, 0.8, 0.2)).true.position
    errors = [np.abs(run - runs[2]).max() / np.abs(plain - runs[2]).max() for run in runs[:2]]
    assert errors[0] < 1e-3
    assert errors[1] < errors[0]


def test_what_is_no_shaft_is_refused() -> None:
    for words, said in (
        (["coupled_shaft:sign=0.5"], "1 for the sum or -1"),
        (["coupled_shaft:inertia=-1"], "expected 0 or more"),
        (["coupled_shaft", "coupled_shaft:joint2"], "given twice"),
    ):
        with pytest.raises(UsageError, match=said):
            simulate(scara(), swing(scara().robot, 0.1), effects=[parse_effect(word) for word in words])
    assert parse_effect("coupled_shaft").resolve(scara()).joint == "joint1"
