"""Periodic effects: columns against simulated arms of all kinds, recovery from noisy recordings."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.effects import Member, SpectralLine
from scara_ident.effects.periodic import ORDERS, EncoderEccentricity, TorqueRipple, Vibration
from scara_ident.model.model import build_model
from scara_ident.motion.low_pass import low_pass
from scara_ident.motion.motion import Motion
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import effects as fx
from scara_ident.simulation import simulate, virtual_arm
from tests.arms import PLANAR_2R, Link, write_urdf
from tests.effects.scenes import columns, fit, moving, scene_of, wandering
from tests.effects.simulated import ARMS, arm_of, run, true_motion, true_scene
from tests.simulation.made import left_over


@pytest.mark.parametrize("kind", ARMS)
@pytest.mark.parametrize("which", ["ripple", "vibration"])
def test_columns_times_true_parameters_are_what_the_simulated_arm_adds(kind: str, which: str, tmp_path: Path):
    arm = arm_of(kind, tmp_path)
    joint, unit = arm.robot.joints[0], float(arm.torque_scale[0])
    size = 0.05 * unit
    if which == "ripple":
        switch, effect, member = fx.TorqueRipple(joint, 3.0, size, 0.7), TorqueRipple(), Member(0, (3.0,))
    else:
        switch, effect, member = fx.Vibration(joint, 6.0, size, 0.7), Vibration(), Member(0, (6.0,))
    result = run(arm, switch)
    scene = true_scene(result)
    added = left_over(arm, result.true)
    value = size * np.array([np.cos(0.7), np.sin(0.7)])
    found = np.einsum("jkn,k->jn", columns(effect, scene, true_motion(result), member), value)
    # At the very start the arm is held or let go at rest, where the speed has no sign.
    seen = np.isfinite(added) & np.all(result.true.velocity != 0.0, axis=0)
    assert np.abs(found - added)[seen].max() < 1e-8 * unit
    told = effect.parameters(scene, member, value, 1e-6 * np.eye(2))
    assert [told["amplitude"].value, told["phase"].value] == pytest.approx([size, 0.7])
    assert told["amplitude"].unit == arm.robot.torque_unit(0)


@pytest.mark.parametrize("kind", ARMS)
def test_an_eccentric_encoder_changes_the_torque_to_first_order(kind: str, tmp_path: Path):
    arm = arm_of(kind, tmp_path)
    j, order, size, phase = 1, 2.0, 1e-6, 0.4
    robot = arm.robot
    scene = true_scene(run(arm, fx.OffsetDrift(robot.joints[0], 0.0)))
    item = moving(robot, 1.0)
    n = order * robot.reduction[j]
    # The reading errs by e of the true position; q is what is read, so that e's argument is off by e itself.
    angle, rate = n * item.q[j] + phase, n * item.v[j]
    error = [
        size * np.sin(angle),
        size * rate * np.cos(angle),
        size * (n * item.a[j] * np.cos(angle) - rate**2 * np.sin(angle)),
    ]
    state = [part.copy() for part in (item.q, item.v, item.a)]
    for part, e in zip(state, error, strict=True):
        part[j] -= e
    true = Motion(item.name, item.trajectory, item.time, *state, None, item.rate)
    same = np.sign(true.v) == np.sign(item.v)
    torque = [np.einsum("jpn,p->jn", scene.model.regressor(part), scene.value) for part in (item, true)]
    change = torque[1] - torque[0]
    value = size * np.array([np.cos(phase), np.sin(phase)])
    found = np.einsum("jkn,k->jn", columns(EncoderEccentricity(), scene, item, Member(j, (order,))), value)
    assert np.abs(found - change)[same].max() < 2e-3 * np.abs(change[same]).max()
    told = EncoderEccentricity().parameters(scene, Member(j, (order,)), value, 1e-16 * np.eye(2))
    assert told["amplitude"].value == pytest.approx(size)
    assert told["amplitude"].unit == ("m" if robot.prismatic[j] else "rad")


def test_orders_of_which_the_travel_holds_too_few_periods_are_doubtful():
    # 2 rad of the motor of one joint hold 0.32 turns, of the other 32; fast joints leave the highest orders out.
    scene = scene_of(replace(load_robot(), reduction=np.array([1.0, 100.0])))
    assert TorqueRipple().members(scene) == tuple(
        Member(j, (x,)) for j, orders in ((0, (8.0, 12.0)), (1, ORDERS)) for x in orders
    )
    few = tuple(Member(0, (x,)) for x in (1.0, 2.0, 3.0, 4.0, 5.0, 6.0))
    # Two radians hold less than a turn of what is behind a gear.
    behind = tuple(Member(1, (x,)) for x in (0.01, 0.02, 0.03))
    assert TorqueRipple().doubtful(scene) == few + behind
    assert EncoderEccentricity().doubtful(scene) == (Member(0, (1.0,)), Member(0, (2.0,)))
    fast = replace(scene, speed=np.array([2.0, 2.0]) * 200.0)
    assert TorqueRipple().doubtful(fast) == few + behind
    assert len(TorqueRipple().members(fast)) < len(TorqueRipple().members(scene))


def test_what_is_behind_a_gear_is_tried_where_the_travel_holds_two_periods(tmp_path: Path):
    """A shoulder with two periods per turn was a spring, as nothing slower than 0.4 periods per motor turn was tried."""
    scene = scene_of(replace(load_robot(), reduction=np.array([-100.0, 80.0])))
    slow = {item for item in TorqueRipple().doubtful(scene) if item.nonlinear[0] < 0.1}
    assert slow == {Member(0, (x / 100.0,)) for x in (1.0, 2.0, 3.0)} | {
        Member(1, (x / 80.0,)) for x in (1.0, 2.0, 3.0)
    }
    wide = replace(scene, travel=np.array([5.0, 7.0]))
    tried = {item for item in TorqueRipple().members(wide) if item.nonlinear[0] < 0.1}
    assert tried == {Member(0, (0.03,)), Member(1, (2.0 / 80.0,)), Member(1, (3.0 / 80.0,))}
    assert slow - tried == {item for item in TorqueRipple().doubtful(wide) if item.nonlinear[0] < 0.1}
    for item in slow:
        ((lower, upper),) = TorqueRipple().limits(scene, item)
        assert lower < item.nonlinear[0] < upper
    assert all(item.nonlinear[0] >= 1.0 for item in EncoderEccentricity().doubtful(scene))
    # Once per turn is what balances a joint, or gravity itself, where gravity loads it.
    loaded = scene_of(load_robot(write_urdf(tmp_path / "arm.urdf", PLANAR_2R, [50.0, 50.0])))
    assert {item.nonlinear[0] for item in TorqueRipple().doubtful(loaded)} == {0.04, 0.06}


@pytest.mark.parametrize(
    ("order", "reduction", "said"),
    [(0.02, 100.0, "0.02 periods per motor turn (2 per turn of the joint)"), (0.0125, -80.0, "0.0125 periods per motor turn (1 per turn of the joint)"), (1.0, 100.0, "1 period per motor turn")],
)  # fmt: skip
def test_what_is_behind_a_gear_is_said_per_turn_of_the_joint(order: float, reduction: float, said: str):
    scene = scene_of(replace(load_robot(), reduction=np.array([reduction, 50.0])))
    assert TorqueRipple().description(scene, Member(0, (order,))) == f"a torque ripple of {said}"


def test_lines_that_alias_into_a_band_are_left_out():
    scene = scene_of(load_robot())
    item = moving(scene.robot, 2.0, rate=200.0)
    hertz = np.abs(6.0 * 100.0 * item.v[0]) / (2.0 * np.pi)
    sine = columns(TorqueRipple(), scene, item, Member(0, (6.0,)))[0]
    # Below that an alias at 200 Hz is above 80 Hz, twice the widest band that is chosen.
    assert np.any(hertz > 120.0)
    assert np.all(sine[:, hertz > 120.0] == 0.0)
    slow = hertz < 60.0
    assert np.hypot(*sine[:, slow]) == pytest.approx(np.ones(np.count_nonzero(slow)))


@pytest.mark.parametrize(("effect", "most"), [(TorqueRipple(), 0.03), (EncoderEccentricity(), 0.2)])
def test_a_line_that_leaves_the_band_leaves_little_there(effect: TorqueRipple | EncoderEccentricity, most: float):
    """As sampled ten times as often: one that ended at once would click by 0.1 and 1.3, which another of that order takes up."""
    scene = scene_of(load_robot())
    j, order, slow, more = 1, 2.0, 100.0, 10
    fine, coarse = (moving(scene.robot, 8.0, rate=rate) for rate in (more * slow, slow))
    exact = low_pass(columns(effect, scene, fine, Member(j, (order,)))[j], fine.rate, 0.2 * slow)[:, ::more]
    found = low_pass(columns(effect, scene, coarse, Member(j, (order,)))[j], slow, 0.2 * slow)
    hertz = np.abs(order * scene.robot.reduction[j] * coarse.v[j]) / (2.0 * np.pi)
    assert np.max(hertz) > 0.6 * slow > 0.2 * slow > np.min(hertz)
    # Away from the ends, where the filter guesses how lines go on.
    error, exact = (found - exact)[:, 20:-20], exact[:, 20:-20]
    assert np.sqrt(np.mean(error**2)) < most * np.sqrt(np.mean(exact**2))


def test_one_is_said_in_the_singular():
    scene = scene_of(load_robot())
    assert TorqueRipple().description(scene, Member(0, (1.0,))) == "a torque ripple of 1 period per motor turn"
    assert TorqueRipple().description(scene, Member(0, (2.0,))) == "a torque ripple of 2 periods per motor turn"
    assert (
        EncoderEccentricity().description(scene, Member(0, (1.0,))) == "an encoder error with 1 period per motor turn"
    )


@pytest.mark.parametrize(("effect", "said"), [(TorqueRipple(), "a torque ripple of"), (EncoderEccentricity(), "an encoder error with")])  # fmt: skip
@pytest.mark.parametrize("reduction", [1.0, -1.0])
def test_where_no_gear_is_stated_the_turn_is_the_joints(
    effect: TorqueRipple | EncoderEccentricity, said: str, reduction: float
):
    """Four periods per turn of a wrist behind a gear that nobody had stated were told as four per motor turn, which they are not."""
    scene = scene_of(replace(load_robot(), reduction=np.array([reduction, 50.0])))
    joints = "(a turn of the joint: its reduction is 1)"
    assert effect.description(scene, Member(0, (4.159,))) == f"{said} 4.159 periods per motor turn {joints}"
    assert "a turn of the joint" not in effect.description(scene, Member(1, (4.0,)))


@pytest.mark.parametrize(
    ("order", "said"),
    [(1.595, ", which would be 2 with a reduction of 79.75"), (2.02, ", which would be 2 with a reduction of 101"), (2.004, ""), (31.4, ""), (0.3, "")],
)  # fmt: skip
def test_periods_that_are_no_whole_number_ask_for_the_reduction(order: float, said: str):
    """Three wrists of a measured arm had lines of 1.6 and 8 periods behind a reduction taken for 100: behind one of 80 they are 2 and 10."""
    scene = scene_of(load_robot())
    assert scene.robot.reduction[0] == 100.0
    assert TorqueRipple().description(scene, Member(0, (order,))).partition(" per motor turn")[2] == said


def test_members_are_those_that_can_be_seen():
    scene = scene_of(load_robot())
    assert Member(0, (2.0,)) in TorqueRipple().members(scene)
    narrow = replace(scene, band=2.0)
    assert max(member.nonlinear[0] for member in TorqueRipple().members(narrow)) < 12.0
    short = replace(scene, travel=np.array([0.03, 2.0]))
    assert {member.joint for member in EncoderEccentricity().members(short)} == {1}
    assert Vibration().members(scene) == ()
    assert Vibration().seeds(scene, 1, SpectralLine("frequency", 7.5)) == (Member(1, (7.5,)),)
    assert Vibration().seeds(scene, 1, SpectralLine("frequency", 0.01)) == ()
    assert Vibration().seeds(scene, 1, SpectralLine("order", 7.5)) == ()
    assert TorqueRipple().seeds(scene, 0, SpectralLine("order", 1.37)) == (Member(0, (1.37,)),)
    assert TorqueRipple().seeds(scene, 0, SpectralLine("frequency", 1.37)) == ()
    assert TorqueRipple().resolution(scene, Member(0, (2.0,)))[0] == pytest.approx(2.0 * np.pi / 200.0)


def test_a_free_phase_has_columns_for_each_recording():
    scene = scene_of(load_robot(), start={"a": 0.0, "m": 0.0})
    item = moving(scene.robot, 1.0)
    effect, member = Vibration(free_phase=True), Member(0, (5.0,))
    found = columns(effect, scene, item, member)[0]
    assert np.all(found[:2] == 0.0)
    assert np.array_equal(found[2:], columns(Vibration(), scene, item, member)[0])
    told = effect.parameters(scene, member, np.array([0.3, 0.4, 0.0, 0.5]), 1e-4 * np.eye(4))
    assert told["amplitude"].value == pytest.approx(0.5)
    assert set(told) == {"amplitude"}
    assert not np.any(columns(effect, scene, replace(item, name="new"), member))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("switch", "effect", "member"),
    [
        (fx.TorqueRipple("joint2", 2.0), TorqueRipple(), Member(1, (2.0,))),
        (fx.EncoderEccentricity("joint1", 4e-5), EncoderEccentricity(), Member(0, (1.0,))),
        (fx.Vibration("joint1", 7.3), Vibration(), Member(0, (7.3,))),
        (fx.Vibration("joint1", 7.3), Vibration(free_phase=True), Member(0, (7.3,))),
    ],
)
def test_parameters_are_recovered_from_noisy_closed_loop_recordings(switch, effect, member):
    arm = virtual_arm()
    runs = [simulate(arm, wandering(arm, f"w{k}", k), effects=[switch], seed=k) for k in (1, 2)]
    model = build_model(arm.robot, "complete")
    scene, value, covariance = fit(model, [item.recording for item in runs], effect, member, band=25.0, rounds=1)
    for name, found in effect.parameters(scene, member, value, covariance).items():
        true = getattr(runs[0].effects[0], name)
        assert abs(found.value - true) < 4.0 * found.std + 0.01 * abs(true), name
        assert found.std < 0.2 * abs(true), name


@pytest.mark.parametrize("reduction", [1.0, 314.0])
def test_a_slide_turns_no_motor_unless_its_reduction_is_stated(tmp_path: Path, reduction: float):
    robot = load_robot(write_urdf(tmp_path / "arm.urdf", [Link("prismatic")], [reduction]))
    # Twenty metres are three turns of 2 pi metres.
    scene = replace(scene_of(robot), travel=np.array([20.0]), speed=np.array([0.1]))
    line = SpectralLine("order", 3.0)
    for effect in (TorqueRipple(), EncoderEccentricity()):
        assert bool(effect.members(scene)) == bool(effect.seeds(scene, 0, line)) == (reduction != 1.0)
        assert all(item.nonlinear[0] >= 1.0 for item in (*effect.members(scene), *effect.doubtful(scene)))
