"""Coupled drives: what the rigid bodies span is not tried, what they do not is recovered."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.effects import Member, Signals
from scara_ident.effects.coupling import DriveCoupling, InertiaCoupling
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot
from tests.arms import example_urdf, recorded_torque, recording, sines
from tests.effects.scenes import columns, fit, moving, scene_of


def test_shared_inertia_of_parallel_axes_is_part_of_the_links():
    assert InertiaCoupling().members(scene_of(load_robot())) == ()


def test_shared_inertia_works_both_ways_and_takes_no_energy():
    robot = load_robot(example_urdf("ur5_robot.urdf"))
    scene, item = scene_of(robot), moving(robot, 1.0)
    pairs = [(member.joint, member.partner) for member in InertiaCoupling().members(scene)]
    assert (4, 5) in pairs
    # Shoulder lift and elbow are parallel: their links' inertia is already shared.
    assert (1, 2) not in pairs
    column = columns(InertiaCoupling(), scene, item, Member(4, (), 5))[:, 0] / robot.row_scale[:, None]
    # Of kinetic energy v4 v5.
    energy = item.v[4] * item.v[5]
    power = np.sum(column * item.v, axis=0)
    work = np.concatenate([[0.0], np.cumsum(0.5 * (power[1:] + power[:-1])) / item.rate])
    assert work == pytest.approx(energy - energy[0], abs=1e-3 * np.abs(energy).max())


def test_the_share_of_a_neighbours_torque_is_recovered():
    robot, rng = load_robot(), np.random.default_rng(3)
    time = np.arange(8000) / 500.0
    data = []
    for k in range(2):
        q, v, a = sines(rng, time, 2, size=0.8, lowest=0.35)
        u = recorded_torque(robot, q, v, a, [(0.1, 0.05, 0.0, 0.0, 0.02)] * 2)
        u[0] += 0.06 * u[1]
        data.append(recording(robot, f"t{k}_1", time, q, u + 0.01 * rng.standard_normal(u.shape)))
    effect, member = DriveCoupling(), Member(0, (), 1)
    assert member in effect.members(scene_of(robot))
    scene, value, covariance = fit(build_model(robot), data, effect, member, rounds=3)
    found = effect.parameters(scene, member, value, covariance)["share"]
    assert found.value == pytest.approx(0.06, abs=4.0 * found.std)
    assert found.std < 0.01


def test_the_neighbours_torque_is_brought_over_by_the_gears():
    scene = scene_of(load_robot(example_urdf("ur5_robot.urdf")))
    item = moving(scene.robot, 0.5)
    predicted = Signals(scene, item).predicted
    column = columns(DriveCoupling(), scene, item, Member(3, (), 4))[3, 0]
    assert column == pytest.approx(predicted[4] * scene.robot.row_scale[3] / scene.robot.row_scale[4])
    assert DriveCoupling().inadmissible(scene, Member(3, (), 4), np.array([1.5]), np.array([0.01]))
