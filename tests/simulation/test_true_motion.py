"""What the arm really does: the equations of motion at every sample, and steps as fine as what is stiff needs."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.errors import LostArm, UsageError
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import VirtualArm, parse_effect, simulate, virtual_arm
from scara_ident.simulation.plant import PlantDraft
from scara_ident.simulation.true_motion import MAX_SUBSTEPS, needed_substeps
from tests.arms import Link, write_urdf
from tests.simulation.made import bare, rigid, scara, swing


def drafted(arm: VirtualArm, *effects: str) -> PlantDraft:
    draft = arm.draft()
    for words in effects:
        parse_effect(words).resolve(arm).apply(arm, draft)
    return draft


def test_torque_and_acceleration_of_a_sample_meet_the_equations_of_motion() -> None:
    arm = bare(scara())
    true = simulate(arm, swing(arm.robot, 1.0)).true
    expected = rigid(arm, true.position, true.velocity, true.acceleration)
    np.testing.assert_allclose(true.effort, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_each_so_many_of_its_samples_are_the_same_of_every_signal() -> None:
    true = simulate(scara(), swing(scara().robot, 0.2)).true
    thin = true.every(7)
    for name, signal in vars(thin).items():
        np.testing.assert_array_equal(signal, getattr(true, name)[:, ::7])


def test_a_stiffer_gear_takes_finer_steps_as_the_root_of_its_stiffness() -> None:
    arm = scara()
    few, many = (
        needed_substeps(arm, drafted(arm, f"joint_elasticity:joint1:stiffness={k}"), 100.0) for k in (4e4, 16e4)
    )
    assert few > 4
    assert many / few == pytest.approx(2.0, rel=0.1)
    assert needed_substeps(arm, drafted(arm), 1000.0) == 0


def test_what_would_take_for_ever_is_refused_with_the_joint_and_what_to_do() -> None:
    arm = scara()
    with pytest.raises(UsageError, match=f"^joint2: so stiff that .*at most {MAX_SUBSTEPS}.*; lower its stiffness"):
        needed_substeps(arm, drafted(arm, "joint_elasticity:joint2:stiffness=1e12"), 1000.0)


def test_an_arm_that_its_controller_loses_says_when() -> None:
    arm = scara()
    # Of the wrong sign it pushes the arm away.
    wild = replace(arm, controller=replace(arm.controller, proportional=-100.0 * arm.controller.proportional))
    with pytest.raises(LostArm, match=r"^swing on scara03: the arm became unstable at \d"):
        simulate(wild, swing(arm.robot, 1.0))


def test_a_link_without_mass_moves_with_its_rotor(tmp_path: Path) -> None:
    """A flange without <inertial> on a joint of its own ended in an internal error: 0 over 0 steps."""
    bare_link = Link(axis=(0.0, 1.0, 0.0), xyz=(0.4, 0.0, 0.0), mass=0.0, com=(0.0, 0.0, 0.0), inertia=(0.0, 0.0, 0.0))
    arm = virtual_arm(load_robot(write_urdf(tmp_path / "flange.urdf", [Link(), bare_link])))
    assert arm.link_inertia()[1] == 0.0
    assert needed_substeps(arm, arm.draft(), 1000.0) < MAX_SUBSTEPS
