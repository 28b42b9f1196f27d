"""Gear losses: the column against simulated arms of all kinds, and what no gear can have."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Literal

import numpy as np
import pytest

from scara_ident.arrays import Array
from scara_ident.effects import Member, Scene, Signals
from scara_ident.effects.gear import TransmissionLoss, second_order, swinging_load
from scara_ident.effects.payload import PayloadChange
from scara_ident.effects.position import Spring
from scara_ident.effects.signals import ModelledEffect
from scara_ident.motion.low_pass import differentiate, low_pass
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import SimulationResult, simulate, virtual_arm
from scara_ident.simulation import effects as fx
from tests.effects.carried import ALWAYS
from tests.effects.scenes import columns, dense, moving, scene_of
from tests.effects.simulated import ARMS, arm_of, run, true_motion, true_scene
from tests.simulation.made import left_over, swing

SHARE = 0.2


@pytest.mark.parametrize("kind", ARMS)
def test_the_column_times_the_share_is_what_the_simulated_gear_loses(kind: str, tmp_path: Path):
    arm = arm_of(kind, tmp_path)
    result = run(arm, fx.TransmissionLoss(arm.robot.joints[0], SHARE))
    scene = replace(true_scene(result), armatures=dict(enumerate(arm.armature.tolist())))
    found = SHARE * columns(TransmissionLoss(), scene, true_motion(result), Member(0, (SHARE,)))[:, 0]
    lost = left_over(arm, result.true)
    seen = np.isfinite(lost) & np.all(result.true.velocity != 0.0, axis=0)
    assert np.count_nonzero(seen) > 0.9 * seen.size
    assert np.abs(found - lost)[seen].max() < 1e-8 * float(arm.torque_scale[0])
    assert np.abs(found[0]).max() > 1e-2 * float(arm.torque_scale[0])


@pytest.mark.slow
@pytest.mark.parametrize("kind", ARMS)
@pytest.mark.parametrize(("mass", "stiffness"), [(1.0, 0.0), (0.0, 1.0), (2.5, 0.5)])
def test_beside_what_acts_on_links_it_is_what_the_simulated_gear_loses_of_all_together(
    kind: str, mass: float, stiffness: float, tmp_path: Path
):
    arm = arm_of(kind, tmp_path)
    stiffness *= 0.2 * float(arm.torque_scale[0])
    # The rest position is what the offset says, and here there is none.
    arm = replace(arm, torque_offset=np.zeros(arm.robot.n))
    joint = arm.robot.joints[0]
    acting = [fx.TransmissionLoss(joint, SHARE), fx.Payload(mass=mass) if mass else None]
    acting.append(fx.Spring(joint, stiffness, 0.0) if stiffness else None)
    result = simulate(arm, swing(arm.robot, 2.0), effects=[item for item in acting if item is not None])
    scene, item = true_scene(result), true_motion(result)
    found = (ModelledEffect(PayloadChange(), ALWAYS, (mass,)), ModelledEffect(Spring(), Member(0), (stiffness,)))
    scene = replace(scene, armatures=dict(enumerate(arm.armature.tolist())), link_torques=found)
    added = columns(PayloadChange(), scene, item, ALWAYS)[:, 0] * mass
    added = added + columns(Spring(), scene, item, Member(0))[:, 0] * stiffness
    told = added + SHARE * columns(TransmissionLoss(), scene, item, Member(0, (SHARE,)))[:, 0]
    left = left_over(arm, result.true)
    seen = np.isfinite(left) & np.all(result.true.velocity != 0.0, axis=0)
    assert np.count_nonzero(seen) > 0.9 * seen.size
    assert np.abs(told - left)[seen].max() < 1e-8 * float(arm.torque_scale[0])
    alone = replace(scene, link_torques=())
    missing = SHARE * columns(TransmissionLoss(), alone, item, Member(0, (SHARE,)))[:, 0] + added - left
    assert np.abs(missing[0])[seen[0]].max() > 1e-3 * float(arm.torque_scale[0])


def behind_coarse_encoders(bits: int) -> tuple[SimulationResult, Scene, Motion]:
    """A swing under a controller that answers the steps of encoders of so many bits, as it is seen in a band of 6 Hz."""
    arm = virtual_arm()
    steps = np.full(2, 2.0**bits) / np.abs(arm.robot.reduction)
    arm, slow = replace(arm, encoder_steps=steps, torque_noise=np.zeros(2)), swing(arm.robot, amplitude=0.2)
    result = simulate(arm, slow, effects=[fx.TransmissionLoss(arm.robot.joints[0], SHARE)], rate=500.0)
    # The motion of the positions without steps, so that what these do to it is no part of what is compared.
    t, cut = result.true, 18.0
    smooth = differentiate(t.position, 500.0, cut)
    motion = Motion("m", "m", result.recording.time, *smooth, result.recording.effort, 500.0, None, (cut, cut))
    return result, replace(true_scene(result), armatures=dict(enumerate(arm.armature.tolist()))), motion


def test_what_a_load_loses_that_swings_faster_than_the_filtered_motion_is_in_the_column():
    result, scene, motion = behind_coarse_encoders(13)
    member, inside = Member(0, (SHARE,)), slice(100, -100)
    scale = float(scene.robot.row_scale[0])
    load, direction = scale * result.true.load[0], result.true.direction[0]
    # What Hamon's law has of the torque that the simulated gear transmits.
    truly = np.abs(load) * direction + (np.sqrt(1.0 + SHARE**2) - 1.0) / SHARE * load

    def missed(item: Motion) -> float:
        found = columns(TransmissionLoss(), scene, item, member)[0, 0]
        return float(np.std(low_pass(found - truly, 500.0, 6.0)[inside]))

    whole = float(np.std(low_pass(truly, 500.0, 6.0)[inside]))
    assert missed(motion.with_torque(None)) > 0.2 * whole
    # The recorded torque is a mean over the controller's period, which takes off the fastest of a swing.
    assert missed(motion) < 0.6 * missed(motion.with_torque(None))


def test_a_gear_transmits_the_links_share_of_a_torque_that_swings_and_nothing_without_a_torque():
    result, scene, motion = behind_coarse_encoders(13)
    signals = Signals(scene, motion)
    part = swinging_load(signals, 0) - signals.load(0)
    share = part @ signals.swing(0) / (signals.swing(0) @ signals.swing(0))
    assert part == pytest.approx(share * signals.swing(0), abs=1e-12)
    beyond = [
        x - low_pass(x, 500.0, 18.0) for x in (scene.robot.row_scale[0] * result.true.load[0], result.true.effort[0])
    ]
    # Other joints swing too, and poses have other inertias than the mean.
    assert share == pytest.approx(beyond[0] @ beyond[1] / (beyond[1] @ beyond[1]), rel=0.25)
    for other in (motion.with_torque(None), replace(motion, cuts=()), replace(motion, cuts=(None, None))):
        assert np.array_equal(swinging_load(Signals(scene, other), 0), Signals(scene, other).load(0))


@pytest.mark.parametrize("share", [0.0, 1e-6, 0.2, 0.75])
def test_the_second_order_is_that_of_an_efficiency_however_small_the_share(share: float):
    efficiency = np.sqrt(1.0 + share**2) - share
    # The mean of what is driven and what drives.
    assert 1.0 + share * second_order(share) == pytest.approx(0.5 * (efficiency + 1.0 / efficiency), rel=1e-15)
    assert second_order(share) == pytest.approx(0.5 * share, rel=share**2)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize(("kind", "joint"), [("scara03", 0), ("ur5", 1)])
def test_the_share_is_its_coefficient_and_slopes_are_the_differences_of_the_torque(
    kind: str, joint: int, order: Literal[1, 2]
):
    robot = load_robot() if kind == "scara03" else load_robot(kind)
    scene, item = scene_of(robot), moving(robot, 0.3)
    effect, bodies = TransmissionLoss(order), len(scene.model.rigid_body.columns)
    found = dense(effect.slopes(Signals(scene, item), Member(joint, (SHARE,))), bodies + 2)
    tie = effect.tie(scene, Member(joint, (SHARE,)))
    assert (tie.value, tie.slopes.tolist()) == (SHARE, [*[0.0] * (bodies + 1), 1.0])

    def torque(at: Scene, share: float = SHARE) -> Array:
        return SHARE * columns(effect, at, item, Member(joint, (share,)))[:, 0]

    def difference(change: Callable[[float], Array], step: float = 1e-5) -> Array:
        return (change(step) - change(-step)) / (2.0 * step)

    expected = [
        difference(lambda x, d=d: torque(replace(scene, value=scene.value + x * d)))
        for d in np.eye(len(scene.value))[:bodies]
    ]
    own = scene.armature(joint)
    expected.append(difference(lambda x: torque(replace(scene, armatures={joint: own + x}))))
    expected.append(difference(lambda x: torque(scene, SHARE + x)))
    size = np.max(np.abs(found), axis=(0, 2), keepdims=True)
    # A load that changes its sign within a step differs.
    wrong = np.abs(found - np.moveaxis(expected, 0, 1)) > 1e-6 * size
    assert np.mean(wrong) < 1e-3
    assert np.all(size[:, -2] > 0.0)
    # By the law of first order the column is the same whatever the share.
    assert np.all((size[:, -1] > 0.0) == (order == 2))


def test_the_other_law_is_without_the_gain_and_says_so():
    scene, item, member = scene_of(load_robot()), moving(load_robot(), 0.3), Member(1, (SHARE,))
    own, (other,) = TransmissionLoss(), TransmissionLoss().other_laws()
    assert other == TransmissionLoss(1) and other.other_laws() == (own,)
    load = Signals(scene, item).load(1)
    column = columns(other, scene, item, member)[:, 0]
    assert np.abs(column[1]) == pytest.approx(np.abs(load))
    assert columns(own, scene, item, member)[1, 0] - column[1] == pytest.approx(second_order(SHARE) * load, abs=1e-12)
    assert own.law() == {}
    assert (other.law()["loss_order"].value, other.law()["loss_order"].std) == (1.0, 0.0)
    said = own.description(scene, member)
    assert (
        other.description(scene, member)
        == f"{said}, with the same loss whether the motor drives the load or the load drives the motor"
    )


def test_what_no_gear_can_have_is_refused():
    scene, member, std = scene_of(load_robot()), Member(1, (0.15,)), np.array([0.01])
    said = [TransmissionLoss().inadmissible(scene, member, np.array([x]), std) for x in (-0.1, 0.8, 0.1, 0.76)]
    assert said[:2] == [
        "the lost share is negative, but a gear cannot give energy",
        "more than three quarters of the torque would be lost",
    ]
    assert said[2:] == [None, None]


def test_the_rotors_share_of_an_inertia_matters_on_its_own_joint():
    assert TransmissionLoss().geared_joint(Member(1, (0.15,))) == 1
    assert {member.joint for member in TransmissionLoss().members(scene_of(load_robot()))} == {0, 1}


@pytest.mark.parametrize("order", [1, 2])
def test_what_a_gear_passes_on_is_its_law_the_other_way_round(order: Literal[1, 2]):
    effect, member, load = TransmissionLoss(order), Member(0, (SHARE,)), 3.0
    # The motor sees 1/eta of the load where it drives and eta where it is driven, by eta = sqrt(1 + c^2) - c.
    eta = np.sqrt(1.0 + SHARE**2) - SHARE
    seen = {1.0: load / eta, -1.0: load * eta} if order == 2 else {1.0: load * 1.2, -1.0: load * 0.8}
    for driving, torque in seen.items():
        assert effect.passes_on(member, np.array([SHARE]), driving) * torque == pytest.approx(load, rel=1e-12)
    still = effect.passes_on(member, np.array([SHARE]), 0.0)
    assert min(1.0, still) > effect.passes_on(member, np.array([SHARE]), 1.0)
