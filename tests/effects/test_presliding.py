"""Presliding: the state against its differential equation, columns against simulated arms, recovery."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scara_ident.effects import Member
from scara_ident.effects.friction import Stribeck
from scara_ident.effects.presliding import (
    DISTANCES,
    SLIDE_DISTANCES,
    SMALLEST_REVERSAL_SHARE,
    Presliding,
    dahl_state,
    turning_points,
)
from scara_ident.effects.signals import ModelledEffect
from scara_ident.model.model import build_model
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import effects as fx
from scara_ident.simulation import simulate, virtual_arm
from tests.arms import Link, write_urdf
from tests.effects.scenes import columns, fit, scene_of, wandering
from tests.effects.simulated import ARMS, arm_of, run, true_motion, true_scene


def stepped(q: np.ndarray, distance: float, start: float = 0.0) -> np.ndarray:
    """The state sample by sample, exact for each step."""
    z = [start]
    for way in np.diff(q):
        end = np.sign(way)
        z.append(end - (end - z[-1]) * np.exp(-abs(way) / distance))
    return np.array(z)


@settings(max_examples=40)
@given(st.lists(st.floats(-1.0, 1.0), min_size=1, max_size=40), st.floats(0.02, 2.0), st.floats(-1.0, 1.0))
def test_the_state_is_that_of_the_differential_equation(steps: list[float], distance: float, start: float):
    q = np.concatenate([[0.3], 0.3 + np.cumsum(steps)])
    # A turn that is left out shifts the state by at most its own share.
    assert dahl_state(q, distance, start) == pytest.approx(
        stepped(q, distance, start), abs=3.0 * SMALLEST_REVERSAL_SHARE
    )


def test_the_state_is_exact_on_a_smooth_path():
    t = np.linspace(0.0, 10.0, 5000)
    q = np.sin(t) + 0.2 * np.sin(5.1 * t)
    assert dahl_state(q, 0.05) == pytest.approx(stepped(q, 0.05), abs=1e-9)


def test_noise_at_rest_leaves_the_state_alone():
    rng = np.random.default_rng(0)
    path = np.concatenate([np.linspace(0.0, 0.1, 100), np.full(20000, 0.1), np.linspace(0.1, 0.0, 100)])
    noisy = path + 2e-6 * rng.standard_normal(len(path))
    clean, found = dahl_state(path, 1e-3), dahl_state(noisy, 1e-3)
    assert np.abs(found - clean).max() < 0.1
    assert np.abs(stepped(noisy, 1e-3) - clean).max() > 0.5


def test_turning_points_alternate_and_are_far_enough_apart():
    rng = np.random.default_rng(1)
    q = np.cumsum(rng.standard_normal(3000))
    places = turning_points(q, 5.0)
    way = np.diff(q[places])
    assert places[0] == 0 and places[-1] == len(q) - 1
    assert np.all(np.abs(way[1:-1]) >= 5.0) and np.all(way[2:-1] * way[1:-2] < 0.0)
    assert turning_points(np.zeros(5), 1.0).tolist() == [0, 4]


@pytest.mark.parametrize("kind", ARMS)
def test_the_column_is_what_the_simulated_arm_adds(kind: str, tmp_path: Path):
    arm = arm_of(kind, tmp_path)
    result = run(arm, fx.Presliding(arm.robot.joints[0], 0.01), 3.0)
    a0 = arm.friction[0, 0]
    scene, item = true_scene(result), true_motion(result)
    column = columns(Presliding(), scene, item, Member(0, (0.01,)))[0, 0]
    side = arm.robot.drive_sign[0]
    added = side * (result.true.direction[0] - np.sign(result.true.velocity[0]))
    # The first way wipes out where the state began; a turn between two samples is off by what is in between.
    seen = np.abs(np.diff(item.q[0], prepend=item.q[0, 0])).cumsum() > 0.08
    assert np.abs(column - added)[seen].max() < 5e-3
    assert np.abs(added[seen]).max() > 1.5
    assert Presliding().inadmissible(scene, Member(0, (0.01,)), np.array([a0]), np.array([0.01 * a0])) is None
    assert Presliding().inadmissible(scene, Member(0, (0.01,)), np.array([2.0 * a0]), np.array([0.01 * a0]))
    assert Presliding().inadmissible(scene, Member(0, (0.01,)), np.array([-a0]), np.array([0.01 * a0]))


def test_what_builds_up_is_all_dry_friction_of_the_joint_that_at_low_speed_too():
    """Of an arm with both the presliding was refused as too much, and then nothing was found (LuGre's model has both)."""
    scene = scene_of(load_robot())
    member, a0 = Member(1, (0.01,)), 0.02
    both, sure = np.array([1.7 * a0]), np.array([0.01 * a0])
    assert "1.5 times the Coulomb friction" in str(Presliding().inadmissible(scene, member, both, sure))

    def beside(joint: int, amplitude: float):
        return replace(scene, beside=(ModelledEffect(Stribeck(), Member(joint, (0.1,)), (amplitude,)),))

    assert Presliding().inadmissible(beside(1, 0.7 * a0), member, both, sure) is None
    # Another joint's has nothing to do with it, and less friction at low speed than at others adds none.
    assert Presliding().inadmissible(beside(0, 0.7 * a0), member, both, sure)
    assert Presliding().inadmissible(beside(1, -0.7 * a0), member, both, sure)
    more = Presliding().inadmissible(beside(1, 0.7 * a0), member, 2.0 * both, sure)
    assert "1.5 times the Coulomb friction and that at low speed" in str(more)
    assert Presliding().inadmissible(beside(1, 0.7 * a0), member, 0.2 * both, sure)


def test_members_are_shorter_than_the_travel():
    scene = scene_of(load_robot())
    assert {member.nonlinear[0] for member in Presliding().members(scene)} == set(DISTANCES)
    assert all(Presliding().nonlinear[0].lower < distance < Presliding().nonlinear[0].upper for distance in DISTANCES)


def test_the_coulomb_friction_is_recovered_and_the_distance_fits_best():
    arm = virtual_arm()
    data = [
        simulate(arm, wandering(arm, f"w{k}", k), effects=[fx.Presliding("joint2", 0.008)], seed=k).recording
        for k in (1, 2)
    ]
    model = build_model(arm.robot, "complete")
    value = {}
    for distance in (0.004, 0.008, 0.016):
        _, found, covariance = fit(model, data, Presliding(), Member(1, (distance,)), band=25.0)
        value[distance] = float(found[0]) / float(np.sqrt(covariance[0, 0]))
        if distance == 0.008:
            assert found[0] == pytest.approx(arm.friction[1, 0], rel=0.03)
    assert max(value, key=lambda key: value[key]) == 0.008


@pytest.mark.parametrize("travel", [0.004, 0.4, 40.0])
def test_distances_of_a_slide_are_shares_of_its_travel_whatever_a_metre_is(tmp_path: Path, travel: float):
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", [Link("prismatic")]))
    scene = replace(scene_of(robot), travel=np.array([max(travel, 0.01)]))
    tried = np.array([member.nonlinear[0] for member in Presliding().members(scene)])
    assert tried / scene.travel[0] == pytest.approx(np.array(SLIDE_DISTANCES) / np.pi)
    ((lower, upper),) = Presliding().limits(scene, Member(0, (tried[0],)))
    assert lower < tried.min() and tried.max() < upper
    # What is known of friction is in newtons, and is none here.
    long = Presliding().inadmissible(scene, Member(0, (0.2 * scene.travel[0],)), np.ones(1), np.ones(1))
    assert "spring" in str(long)
