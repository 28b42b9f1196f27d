"""Errors of the torque's measurement: columns, recovery, and shifting a recording."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.effects import Member, Signals
from scara_ident.effects.filters.position_filter import PositionFilter
from scara_ident.effects.filters.torque_filter import TorqueFilter
from scara_ident.effects.gear import TransmissionLoss
from scara_ident.effects.measurement import (
    BentTorqueSensor,
    TimeDelay,
    TorqueGainMismatch,
    TorqueSensorNonlinearity,
    shifted,
)
from scara_ident.model.model import build_model
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import load_robot
from tests.arms import recorded_torque, recording, sines, ur5
from tests.effects.scenes import columns, fit, moving, scene_of

FRICTION = ((0.1, 0.05, -0.004, 0.0, 0.02), (0.04, 0.03, 0.0, 0.0, -0.01))


def recordings(change, noise: float = 0.01) -> list[Recording]:
    """Recordings of the SCARA03 whose torque goes through ``change(u, time)``."""
    robot, rng = load_robot(), np.random.default_rng(3)
    time = np.arange(8000) / 500.0
    made = []
    for k in range(2):
        q, v, a = sines(rng, time, 2, size=0.8, lowest=0.35)
        u = change(recorded_torque(robot, q, v, a, FRICTION), time)
        made.append(recording(robot, f"t{k}_1", time, q, u + noise * rng.standard_normal(u.shape)))
    return made


def test_columns_are_the_cube_the_torque_and_its_slope():
    scene = scene_of(load_robot())
    item = moving(scene.robot, 2.0, rate=2000.0)
    u = np.einsum("jpn,p->jn", scene.model.regressor(item), scene.value)
    assert columns(TorqueSensorNonlinearity(), scene, item, Member(1))[1, 0] == pytest.approx(u[1] ** 3)
    assert columns(BentTorqueSensor(), scene, item, Member(1))[1, 0] == pytest.approx(u[1] ** 2)
    assert columns(TorqueGainMismatch(), scene, item, Member(1))[1, 0] == pytest.approx(u[1])
    # Without the steps of dry friction the slope is smooth.
    smooth = replace(scene, value=np.where(np.char.startswith(scene.model.names, "a"), 0.0, scene.value))
    u = Signals(smooth, item).predicted
    slope = np.gradient(u, 1.0 / item.rate, axis=1)
    inside = slice(400, -400)
    both = columns(TimeDelay(), smooth, item, Member(None))[:, 0]
    assert np.abs(both + slope)[:, inside].max() < 1e-3 * np.abs(slope).max()
    assert np.array_equal(columns(TimeDelay(), smooth, item, Member(1))[1, 0], both[1])


def test_members_are_those_that_can_be_determined():
    scene = scene_of(load_robot())
    assert [member.joint for member in TorqueGainMismatch().members(scene)] == [1]
    assert [member.joint for member in TimeDelay().members(scene)] == [None, 0, 1]


def test_of_more_than_two_joints_the_first_may_have_the_wrong_scale_too():
    scene, effect = scene_of(ur5()), TorqueGainMismatch()
    assert [member.joint for member in effect.members(scene)] == [0, 1, 2, 3, 4, 5]
    assert effect.estimated_beside(scene, Member(0)) is None
    assert effect.estimated_beside(scene, Member(4)) == Member(0)
    assert (
        effect.description(scene, Member(0))
        == "a torque scale that differs from the other joints', relative to that of the joints not named"
    )
    assert (
        effect.description(scene, Member(4))
        == "a torque scale that differs from the other joints', relative to the first joint's"
    )
    assert effect.or_else(scene, Member(4), np.array([0.1])) == ""
    assert "it is not known which" in effect.or_else(scene_of(load_robot()), Member(1), np.array([0.1]))


@pytest.mark.parametrize(("ratio", "said"), [(0.96, True), (1.04, True), (1.2, False), (0.8, False)])
def test_beside_a_gear_that_loses_it_may_be_that_this_loses_more_one_way(ratio: float, said: bool):
    """A gear that lost 19 % where it was driven and 11 % where it drove was a loss of 15 % and a torque scale, and nothing else was said."""
    effect, value = TorqueGainMismatch(), np.array([ratio - 1.0])
    lost = TransmissionLoss(1), Member(3, (0.15,)), np.array([0.15])
    words = effect.or_else_beside(Member(3), value, [lost])
    # Motor over load is ratio (1 + c) where it drives and ratio (1 - c) where it is driven; a gear that gives energy is none.
    drives, driven = ratio * 1.15 - 1.0, 1.0 - ratio * 0.85
    assert (
        f"loses {drives:.1%} of the torque when the motor drives the load and {driven:.1%} when the load drives the motor"
        in words
    ) is said
    assert (words == "") is not said
    assert effect.or_else_beside(Member(2), value, [lost]) == effect.or_else_beside(Member(3), value, []) == ""


def test_the_ratio_is_to_the_first_joint_with_what_both_scales_are_uncertain_by():
    scene, effect = scene_of(ur5()), TorqueGainMismatch()
    value, covariance = np.array([-0.2, 0.25]), np.array([[4e-6, 1e-6], [1e-6, 9e-6]])
    found = effect.parameters(scene, Member(4), value, covariance)["ratio"]
    drawn = np.random.default_rng(0).multivariate_normal(1.0 + value, covariance, 100_000)
    assert found.value == pytest.approx(0.64)
    # Of so many draws a standard deviation is sure to 1 / sqrt(200,000).
    assert found.std == pytest.approx(np.std(drawn[:, 0] / drawn[:, 1]), rel=0.01)
    alone = effect.parameters(scene, Member(4), value[:1], covariance[:1, :1])["ratio"]
    assert (alone.value, alone.std) == (pytest.approx(0.8), pytest.approx(2e-3))


# Up to 10 % at the largest torques.
@pytest.mark.slow
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(
    ("effect", "name", "size", "unit"),
    [(TorqueSensorNonlinearity(), "cubic", 0.002, "1/(N m)^2"), (BentTorqueSensor(), "square", 0.02, "1/(N m)")],
)
def test_a_channel_that_is_not_straight_is_recovered(
    effect: TorqueSensorNonlinearity, name: str, size: float, unit: str, sign: float
):
    data = recordings(lambda u, t: np.array([u[0] + sign * size * u[0] ** effect.power, u[1]]))
    member = Member(0)
    scene, value, covariance = fit(build_model(load_robot()), data, effect, member, rounds=3)
    found = effect.parameters(scene, member, value, covariance)[name]
    assert found.value == pytest.approx(sign * size, rel=0.02)
    assert found.unit == unit


def test_the_ratio_is_recovered_from_what_the_joints_share():
    data = recordings(lambda u, t: np.array([u[0], 1.12 * u[1]]), noise=0.002)
    effect, member = TorqueGainMismatch(), Member(1)
    scene, value, covariance = fit(build_model(load_robot()), data, effect, member, rounds=3)
    found = effect.parameters(scene, member, value, covariance)["ratio"]
    assert found.value == pytest.approx(1.12, abs=4.0 * found.std)
    assert found.std < 0.02


def test_the_delay_is_recovered_and_shifting_removes_it():
    def late(u, t):
        return np.array([np.interp(t - 0.004, t, row) for row in u])

    data = recordings(late)
    effect, member = TimeDelay(), Member(None)
    model = build_model(load_robot())
    scene, value, covariance = fit(model, data, effect, member, rounds=1)
    first = effect.parameters(scene, member, value, covariance)["delay"]
    assert first.value == pytest.approx(0.004, abs=3e-4)
    again = [shifted(item, first.value) for item in data]
    scene, value, covariance = fit(model, again, effect, member, rounds=1)
    second = effect.parameters(scene, member, value, covariance)["delay"]
    assert first.value + second.value == pytest.approx(0.004, abs=1e-4)


def test_impossible_sizes_are_refused():
    scene = scene_of(load_robot())
    std = np.array([1e-4])
    assert TimeDelay().inadmissible(scene, Member(None), np.array([0.2]), std)
    assert TimeDelay().inadmissible(scene, Member(None), np.array([-0.004]), std) is None
    # A factor of two and a bit, one way and the other: which joint is the reference makes no difference.
    for ratio, said in ((0.2, True), (0.45, True), (0.55, False), (1.6, False), (1.9, False), (2.2, True)):
        assert bool(TorqueGainMismatch().inadmissible(scene, Member(1), np.array([ratio - 1.0]), std)) == said
    # At 2 N m, the limit, what is recorded would fall with the torque.
    assert TorqueSensorNonlinearity().inadmissible(scene, Member(0), np.array([-0.1]), std)
    assert TorqueSensorNonlinearity().inadmissible(scene, Member(0), np.array([-0.08]), std) is None


def test_a_channel_that_bends_one_way_may_not_fold_where_the_torque_is():
    scene, std = scene_of(load_robot()), np.array([1e-4])
    # At 2 N m, the limit, either way.
    for square, refused in ((0.24, False), (0.26, True), (-0.24, False), (-0.26, True)):
        assert bool(BentTorqueSensor().inadmissible(scene, Member(0), np.array([square]), std)) == refused
    model = scene.model
    rows = scene.model.joint_columns(moving(scene.robot, 1.0))
    own = scene.value[model.active[0]]
    lifted = replace(scene, columns={moving(scene.robot, 1.0): (rows[0] * np.sign(own @ rows[0]), *rows[1:])})
    largest = float(np.max(np.abs(own @ rows[0])))
    # A load of one sign leaves the other side open.
    assert BentTorqueSensor().inadmissible(lifted, Member(0), np.array([0.6 / largest]), std) is None
    assert BentTorqueSensor().inadmissible(lifted, Member(0), np.array([-0.6 / largest]), std)


def test_a_channel_may_bend_by_another_law_beyond_what_was_recorded():
    robot = load_robot()
    robot = replace(robot, effort_limit=5.0 * robot.effort_limit)
    scene, motion = scene_of(robot), moving(robot, 1.0)
    held = replace(scene, columns={motion: scene.model.joint_columns(motion)})
    largest = float(np.max(np.abs(Signals(scene, motion).predicted[1])))
    assert 3.0 * largest < robot.torque_limit[1]
    effect, std = TorqueSensorNonlinearity(), np.array([1e-6])
    assert effect.inadmissible(held, Member(1), np.array([-0.3 / largest**2]), std) is None
    assert f"up to {largest:.2g} N m" in effect.inadmissible(held, Member(1), np.array([-0.4 / largest**2]), std)
    assert effect.inadmissible(scene, Member(1), np.array([-0.3 / largest**2]), std)


def tones(time: np.ndarray) -> np.ndarray:
    return np.array([np.sin(40.0 * time) + 0.3 * np.sin(1900.0 * time), 2.0 + 0.5 * time + np.cos(7.0 * time)])


@pytest.mark.parametrize("delay", [0.0042, -0.00073, 0.0005])
def test_shifting_is_exact_at_every_frequency(delay: float):
    robot, time = load_robot(), np.arange(4000) / 1000.0
    item = recording(robot, "t_1", time, np.zeros((2, 4000)), tones(time - delay))
    back = shifted(item, delay)
    assert np.abs(back.effort - tones(time))[:, 300:-300].max() < 2e-3
    assert np.array_equal(back.position, item.position)


def test_shifting_serves_one_joint_and_leaves_the_other():
    robot, time = load_robot(), np.arange(2000) / 1000.0
    item = recording(robot, "t_1", time, np.zeros((2, 2000)), tones(time))
    moved = shifted(item, 0.003, [1])
    assert np.array_equal(moved.effort[0], item.effort[0])
    assert np.abs(moved.effort[1] - tones(time + 0.003)[1])[100:-100].max() < 1e-3
    assert shifted(item, 0.0) is item


def test_shifting_copes_with_jitter_and_does_not_cross_gaps():
    robot, rng = load_robot(), np.random.default_rng(0)
    time = np.arange(3000) / 1000.0 + rng.uniform(-2e-4, 2e-4, 3000)
    time[1500:] += 4.0

    def slow(t):
        return np.array([np.sin(30.0 * t), np.where(t < 3.0, 0.0, 1.0)])

    item = recording(robot, "t_1", time, np.zeros((2, 3000)), slow(time - 0.0026))
    back = shifted(item, 0.0026)
    inside = np.r_[50:1450, 1550:2950]
    assert np.abs(back.effort - slow(time))[0, inside].max() < 1e-4
    assert np.abs(back.effort[1] - slow(time)[1]).max() < 1e-9


def test_a_sample_more_or_less_is_how_torque_is_sampled():
    scene = scene_of(load_robot(), rate=1000.0)
    for member in (Member(0), Member(None)):
        assert "less than one sample" in TimeDelay().negligible(scene, member, np.array([-0.0007]))
        assert TimeDelay().negligible(scene, member, np.array([0.0014])) is None
    assert "-0.7 ms" in TimeDelay().negligible(scene, Member(None), np.array([-0.0007]))
    assert TorqueGainMismatch().negligible(scene, Member(1), np.array([1e-9])) is None


@pytest.mark.parametrize("joint", [None, 1])
def test_a_delay_is_taken_out_of_the_joints_that_have_it(joint: int | None):
    robot, time = load_robot(), np.arange(2000) / 1000.0
    item = recording(robot, "t_1", time, np.zeros((2, 2000)), tones(time))
    effect, member, value = TimeDelay(), Member(joint), np.array([0.0031])
    assert effect.corrects_data(member) == (joint is None)
    recorded = effect.corrected(item, member, value).effort
    assert np.array_equal(recorded[0], item.effort[0]) == (joint == 1)
    np.testing.assert_allclose(recorded[1, 100:-100], tones(time + 0.0031)[1, 100:-100], rtol=0.0, atol=1e-3)
    assert not effect.settled(value)
    assert effect.settled(np.array([1e-6]))


def test_a_delay_below_nothing_says_that_the_position_is_the_later_one():
    scene, delay = scene_of(load_robot()), TimeDelay()
    assert delay.or_else(scene, Member(None), np.array([0.005])) == ""
    assert "the position is later than the effort" in delay.or_else(scene, Member(None), np.array([-0.005]))


def test_only_what_is_late_by_more_than_a_sample_may_be_filtered():
    scene, delay = scene_of(load_robot(), rate=500.0), TimeDelay()
    assert delay.leaves(scene, Member(None), np.array([0.0015])) is None
    assert delay.leaves(scene, Member(None), np.array([-0.0015])) is None
    assert delay.leaves(scene, Member(None), np.array([0.02])) == (TorqueFilter(0.02), Member(None), pytest.approx(7.5))
    found = delay.leaves(scene, Member(None), np.array([-0.02]))
    assert found == (PositionFilter(0.02), Member(None), pytest.approx(7.5))
    # A mean of twice its delay keeps most there.
    assert np.sinc(0.04 * found[2]) == pytest.approx(0.86, abs=0.01)
