"""A simulated arm has the parameters it was given."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.errors import UsageError
from scara_ident.model.base_parameters import find_base_parameters, standard_regressor
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import VirtualArm, ideal, on_side, simulate, virtual_arm
from scara_ident.simulation.effects import Backlash, JointElasticity
from tests.arms import Link, write_urdf
from tests.simulation.made import scara, swing

TREE_LINKS = (
    Link(axis=(0.0, 0.0, 1.0), mass=6.0),
    Link(kind="prismatic", axis=(1.0, 0.0, 0.4), xyz=(0.2, 0.0, 0.1), rpy=(0.3, -0.2, 0.5), mass=3.0),
    Link(axis=(0.0, 1.0, 0.0), xyz=(0.1, 0.0, 0.1), rpy=(0.1, 0.4, 0.0), mass=2.0),
    Link(axis=(-1.0, 0.0, 0.0), xyz=(-0.1, 0.2, 0.0), mass=1.5, parent=0),
)


def assert_own_parameters(arm: VirtualArm, duration: float) -> None:
    robot, n = arm.robot, arm.robot.n
    true = simulate(arm, swing(robot, duration)).true
    keep = np.all(true.velocity != 0.0, axis=0)
    q, v, a = true.position[:, keep], true.velocity[:, keep], true.acceleration[:, keep]
    base = find_base_parameters(robot)
    inertial = standard_regressor(robot, q, v, a)[:, base.kept] * robot.row_scale[:, None, None]
    columns = [inertial]
    for j in range(n):
        own = np.zeros((n, 5, v.shape[1]))
        speed = robot.drive_sign[j] * v[j]
        own[j] = np.sign(speed), speed, np.abs(speed) * speed, speed**3, np.ones_like(speed)
        columns.append(own)
    stacked = np.concatenate(columns, axis=1).transpose(0, 2, 1).reshape(n * q.shape[1], -1)
    size = np.linalg.norm(stacked, axis=0)
    found = np.linalg.lstsq(stacked / size, true.effort[:, keep].ravel(), rcond=None)[0] / size
    standard = np.concatenate([arm.bodies.ravel(), arm.armature])
    expected = np.concatenate(
        [base.grouping @ standard, *(np.append(arm.friction[j], arm.torque_offset[j]) for j in range(n))]
    )
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())
    small = np.abs(found[len(base.kept) :] - expected[len(base.kept) :])
    assert small.max() < 1e-6 * np.abs(true.effort).max()


@pytest.mark.slow
@pytest.mark.parametrize("side", ["motor", "joint"])
def test_least_squares_on_exact_signals_give_the_arm_its_own_parameters(side: str) -> None:
    arm = on_side(replace(scara(), torque_offset=np.array([0.03, -0.02])), side)
    arm = replace(arm, friction=arm.friction + np.array([[0, 0, 0, 0.01], [0, 0, 0, -0.002]]))
    assert_own_parameters(arm, duration=12.0)


def test_least_squares_give_back_parameters_of_a_branched_arm_with_reversing_gears(tmp_path: Path) -> None:
    write_urdf(tmp_path / "tree.urdf", TREE_LINKS)
    text = "urdf: tree.urdf\neffort_side: motor\njoints:\n"
    for name, ratio in zip(("j4", "j1", "j3", "j2"), (-50, 100, 80, -30), strict=True):
        text += f"  {name}: {{reduction: {ratio}, rotor_inertia: 1.0e-4}}\n"
    (tmp_path / "robot.yaml").write_text(text)
    robot = load_robot(tmp_path / "robot.yaml")
    assert list(robot.order) != sorted(robot.order)
    arm = ideal(virtual_arm(robot))
    assert_own_parameters(replace(arm, torque_offset=0.1 * arm.torque_scale), duration=8.0)


def test_the_same_seed_gives_the_same_recording() -> None:
    arm = virtual_arm()
    motion = swing(arm.robot, 0.5)
    one, same, other = (simulate(arm, motion, seed=seed).recording for seed in (3, 3, 4))
    np.testing.assert_array_equal(one.position, same.position)
    np.testing.assert_array_equal(one.effort, same.effort)
    assert not np.array_equal(one.effort, other.effort)


def test_repetitions_have_noise_of_their_own_of_the_size_asked_for() -> None:
    arm = virtual_arm()
    motion = swing(arm.robot, 4.0)
    runs = [simulate(arm, motion, repetition=k) for k in (1, 2)]
    assert [run.recording.name for run in runs] == ["swing_1", "swing_2"]
    quiet = simulate(replace(arm, torque_noise=np.zeros(2)), motion, repetition=1).recording.effort
    noise = runs[0].recording.effort - quiet
    np.testing.assert_allclose(noise.std(axis=1), arm.torque_noise, rtol=0.05)
    other = simulate(replace(arm, torque_noise=np.zeros(2)), motion, repetition=2).recording.effort
    assert abs(np.corrcoef(noise[0], (runs[1].recording.effort - other)[0])[0, 1]) < 0.06


def test_position_is_counted_in_encoder_steps() -> None:
    arm = virtual_arm()
    result = simulate(arm, swing(arm.robot, 1.0))
    step = 2.0 * np.pi / 2000.0 / 100.0
    counts = result.recording.position / step
    np.testing.assert_allclose(counts, np.round(counts), atol=1e-6)
    error = result.recording.position - result.true.position
    assert np.ptp(error) <= 2.0 * step
    assert np.abs(error).max() <= step


def test_recorded_effort_does_not_lag_position() -> None:
    # The central second difference of position is centred on the sample; so must the effort be.
    arm = replace(scara(), friction=np.zeros((2, 4)))
    result = simulate(arm, swing(arm.robot, 3.0))
    true = result.true
    acceleration = np.diff(true.position, 2, axis=1) * 1e6
    from tests.simulation.made import rigid

    middle = rigid(arm, true.position[:, 1:-1], true.velocity[:, 1:-1], acceleration)
    recorded = result.recording.effort
    errors = [np.abs(recorded[:, 1 + k : recorded.shape[1] - 1 + k] - middle)[:, 5:-5].max() for k in (-1, 0, 1)]
    assert errors[1] < 0.1 * min(errors[0], errors[2])


def test_a_recording_slower_than_the_controller_holds_every_so_many_of_its_samples() -> None:
    arm = scara()
    motion = swing(arm.robot, 1.0)
    whole, part = simulate(arm, motion, rate=1000.0), simulate(arm, motion, rate=200.0, ticks=5)
    np.testing.assert_array_equal(part.recording.time, whole.recording.time[::5])
    np.testing.assert_array_equal(part.recording.position, whole.recording.position[:, ::5])
    np.testing.assert_array_equal(part.recording.effort, whole.recording.effort[:, ::5])
    for name in ("velocity", "link_acceleration", "effort"):
        np.testing.assert_array_equal(getattr(part.true, name), getattr(whole.true, name)[:, ::5])
    np.testing.assert_array_equal(part.motion.position, whole.motion.position[:, ::5])


def test_an_averaged_torque_keeps_its_integral() -> None:
    arm = scara()
    motion = swing(arm.robot, 1.0)
    whole = simulate(arm, motion, rate=1000.0).recording.effort
    averaged = simulate(arm, motion, rate=200.0, ticks=5, averaged=True).recording.effort
    # Five whole samples about each of the slower ones.
    expected = np.array([np.convolve(row, np.full(5, 0.2), mode="same") for row in whole])[:, ::5]
    np.testing.assert_allclose(averaged[:, 1:-1], expected[:, 1:-1], atol=1e-12)
    with pytest.raises(UsageError, match="ticks is 0"):
        simulate(arm, motion, ticks=0)


def test_velocity_is_recorded_only_when_asked_for() -> None:
    arm = virtual_arm()
    motion = swing(arm.robot, 1.0)
    assert simulate(arm, motion).recording.velocity is None
    result = simulate(arm, motion, record_velocity=True)
    lag = np.abs(result.recording.velocity - result.true.velocity).max()
    assert 1e-3 < lag < 0.1


def test_another_arms_motion_is_refused() -> None:
    motion = replace(swing(scara().robot, 0.5), joints=("a", "b"))
    with pytest.raises(UsageError, match="moves a, b, the arm has joint1, joint2"):
        simulate(scara(), motion)


def test_a_second_encoder_reads_the_link_and_changes_nothing_else() -> None:
    arm = virtual_arm()
    effects = [JointElasticity("joint1", 2400.0), Backlash("joint2", 0.002)]
    motion = swing(arm.robot, 1.0)
    plain = simulate(arm, motion, effects=effects, seed=2)
    result = simulate(arm, motion, effects=effects, seed=2, link_encoders=["joint1"])
    np.testing.assert_array_equal(result.recording.effort, plain.recording.effort)
    assert plain.recording.link_position is None
    read = result.recording.link_position
    assert np.isnan(read[1]).all()
    error = read[0] - result.true.link_position[0]
    assert np.abs(error).max() <= arm.encoder_resolution[0]
    assert np.abs(result.true.position - result.true.link_position)[0].max() > 20.0 * arm.encoder_resolution[0]
    with pytest.raises(UsageError, match="its joints are joint1, joint2"):
        simulate(arm, motion, link_encoders=["joint3"])
