"""Steps between events: conserved energy, closed forms of coasting and ringing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from scara_ident.robot.robot import load_robot
from scara_ident.simulation import VirtualArm, free_motion, ideal, virtual_arm
from scara_ident.simulation.effects import JointElasticity
from scara_ident.simulation.spatial import configuration
from tests.arms import PLANAR_2R, write_urdf
from tests.simulation.made import bare, scara, tree


def energy(arm: VirtualArm, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    model, data = arm.robot.model, arm.robot.model.createData()
    rotors = 0.5 * np.sum(arm.armature[:, None] * v**2, axis=0)
    back = np.argsort(arm.robot.order)
    links = [
        pin.computeKineticEnergy(model, data, configuration(model, x), y)
        + pin.computePotentialEnergy(model, data, configuration(model, x))
        for x, y in zip(q[back].T, v[back].T, strict=True)
    ]
    return rotors + np.array(links)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["scara", "vertical", "tree"])
def test_without_losses_and_control_energy_is_conserved(kind: str, tmp_path: Path) -> None:
    links = {"vertical": lambda: load_robot(write_urdf(tmp_path / "v.urdf", PLANAR_2R)), "tree": lambda: tree(tmp_path)}
    arm = bare(scara()) if kind == "scara" else bare(ideal(virtual_arm(links[kind]())))
    n = arm.robot.n
    start = np.linspace(0.4, 1.1, n), np.linspace(1.8, -1.3, n)
    if kind == "tree":  # no end stop holds a sliding link: keep it from falling for 10 s
        arm = replace(arm, robot=replace(arm.robot, model=weightless(arm.robot.model)))
    time, true = free_motion(arm, *start, 10.0)
    every = slice(None, None, 50)
    total = energy(arm, true.position[:, every], true.velocity[:, every])
    kinetic = 0.5 * float(np.max(arm.armature @ true.velocity**2))
    assert time[-1] == 10.0
    assert np.ptp(true.position, axis=1).min() > 0.5
    assert np.abs(total - total[0]).max() < 1e-6 * kinetic


def weightless(model: pin.Model) -> pin.Model:
    model = pin.Model(model)
    model.gravity.linear = np.zeros(3)
    return model


def test_an_elastic_arm_without_damping_conserves_energy() -> None:
    arm = bare(scara())
    spring = JointElasticity(joint="joint1", stiffness=9000.0, damping_ratio=0.0)
    _, true = free_motion(arm, np.array([0.3, 0.5]), np.array([2.0, -1.0]), 10.0, effects=[spring])
    every = slice(None, None, 50)
    link_only = replace(arm, rotor_inertia=np.array([0.0, arm.rotor_inertia[1]]))
    total = energy(link_only, true.link_position[:, every], true.link_velocity[:, every])
    total += 0.5 * arm.armature[0] * true.velocity[0, every] ** 2
    total += 0.5 * 9000.0 * (true.position - true.link_position)[0, every] ** 2
    assert np.abs(true.position - true.link_position)[0].max() > 1e-4
    assert np.abs(total - total[0]).max() < 1e-6 * total[0]


def test_a_coasting_joint_stops_once_and_stays() -> None:
    arm = scara()
    _, true = free_motion(arm, [0.0, 0.5], [1.5, -1.0], 6.0)
    for v in true.velocity:
        stop = int(np.flatnonzero(v == 0.0)[0])
        assert np.all(v[stop:] == 0.0)
        assert np.count_nonzero(np.diff(np.sign(v[:stop]))) <= 1


def test_a_sliding_joint_stops_when_its_momentum_is_spent() -> None:
    # One joint, constant torque against Coulomb friction alone: v0 = (c - u) N t / J.
    arm = scara()
    arm = replace(arm, friction=np.array([[0.3, 0, 0, 0], [0.5, 0, 0, 0]]))
    _, true = free_motion(arm, [0.0, 0.0], [1.0, 0.0], 3.0, torque=np.array([0.1, 0.0]))
    assert np.all(true.velocity[1] == 0.0)
    inertia = arm.link_inertia()[0] + arm.armature[0]
    assert true.velocity[0, 400] == pytest.approx(1.0 - 0.4 * 20.0 / inertia, abs=1e-9)
    way = inertia / (2.0 * 20.0)
    assert true.position[0, -1] == pytest.approx(way, abs=1e-9)


def test_elastic_joint_rings_at_its_resonance() -> None:
    arm = bare(scara())
    stiffness = 20000.0
    # The other joint's drive is held by friction that nothing breaks, so its link turns with link 1.
    arm = replace(arm, friction=np.array([[0, 0, 0, 0], [50.0, 0, 0, 0]]))
    effect = JointElasticity(joint="joint1", stiffness=stiffness, damping_ratio=0.0)
    rate = 4000.0
    time, true = free_motion(arm, [0.0, 0.0], [0.0, 0.0], 2.0, torque=np.array([0.1, 0.0]), effects=[effect], rate=rate)
    link, rotor = arm.link_inertia()[0], arm.armature[0]
    expected = np.sqrt(stiffness * (1.0 / link + 1.0 / rotor)) / (2 * np.pi)
    wind_up = (true.position - true.link_position)[0]
    wind_up = wind_up - wind_up.mean()
    crossings = np.flatnonzero((wind_up[:-1] < 0.0) & (wind_up[1:] >= 0.0))
    exact = time[crossings] - wind_up[crossings] / np.diff(wind_up)[crossings] / rate
    assert (len(exact) - 1) / (exact[-1] - exact[0]) == pytest.approx(expected, rel=1e-4)
