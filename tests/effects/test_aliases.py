"""What a model absorbs on any data: the SCARA03's known aliases, and that other arms and models have others."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.effects.aliases import aliases
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot
from tests.arms import PLANAR_2R, example_urdf, write_urdf


def found(robot, name: str = "complete", seed: int = 0):
    return {alias.effect: alias for alias in aliases(build_model(robot, name), seed=seed)}


def test_the_scara_absorbs_what_the_founding_equations_say():
    known = found(load_robot())
    assert known["rotor_coupling"].absorbed_by == ("P_d1", "P_d4", "P_d5")
    assert known["rotor_coupling"].joints == ("joint2",)
    assert known["constant_payload"].absorbed_by == ("P_d1", "P_d2", "P_d4")
    assert known["link_length"].absorbed_by == ("P_d1", "P_d2", "P_d3")
    assert known["joint_zero"].absorbed_by == ("P_d2", "P_d3")
    assert known["asymmetric_coulomb"].absorbed_by == ("p_o1", "p_o2")
    assert known["aerodynamic_drag"].absorbed_by == ("a21", "a22")
    assert known["iron_loss"].absorbed_by == ("a01", "a11", "a02", "a12")
    assert len(known["common_torque_scale"].absorbed_by) == 15
    assert all(alias.opened_by for alias in known.values())


def test_a_model_with_fewer_parameters_absorbs_less():
    reduced = found(load_robot(), "reduced")
    # No offset; no P_d3, so that the second link's zero shows. The first joint's never does: nothing depends on it.
    assert "asymmetric_coulomb" not in reduced
    assert "link_length" not in reduced
    assert reduced["joint_zero"].joints == ("joint1",)
    assert reduced["joint_zero"].absorbed_by == ()
    assert "aerodynamic_drag" not in found(load_robot(), "basic")


def test_known_gravity_opens_the_length_of_a_link(tmp_path: Path):
    planar = found(load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R)))
    assert "link_length" not in planar
    assert "joint_zero" in planar


def test_rotors_on_links_of_any_arm_are_absorbed_by_the_inertias_of_links():
    arm = found(load_robot(example_urdf("ur5_robot.urdf")), "basic")
    assert len(arm["rotor_coupling"].joints) == 5
    assert set(arm["joint_zero"].joints) == {"shoulder_pan_joint", "wrist_3_joint"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "joints", "carriers"),
    [
        ("z1", ("joint2",), ("mx2", "mz2")),
        ("xarm7", ("joint2",), ("mx2", "my2")),
        ("panda", ("panda_joint2",), ("mx2", "my2")),
    ],
)
def test_a_balanced_shoulder_is_a_heavier_link(robot: str, joints: tuple[str, ...], carriers: tuple[str, ...]):
    balanced = found(load_robot(robot), "basic")["gravity_counterbalance"]
    assert (balanced.joints, balanced.absorbed_by) == (joints, carriers)


def test_a_tilted_base_tells_a_balancer_from_the_link():
    level = load_robot("z1")
    tilted = level.model.copy()
    tilted.gravity.linear = 9.81 * np.array([np.sin(0.1), 0.0, -np.cos(0.1)])
    # The first joint's axis is then no longer vertical, and what balances that joint is its own link's.
    assert found(replace(level, model=tilted), "basic")["gravity_counterbalance"].joints == ("joint1",)


def test_a_counterbalance_shows_where_gravity_does_not_turn_with_the_joint(tmp_path: Path):
    # No gravity on the SCARA's vertical axes; of a planar arm, only the first joint's gravity turns with its own angle.
    assert "gravity_counterbalance" not in found(load_robot())
    planar = load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R))
    assert found(planar)["gravity_counterbalance"].joints == planar.joints[:1]


@pytest.mark.parametrize("seed", [1, 2])
def test_random_states_do_not_decide(seed: int):
    assert aliases(build_model(load_robot()), seed=seed) == aliases(build_model(load_robot()))
