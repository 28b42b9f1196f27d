"""A check against the torque that the virtual arm needed, and what it says of motions that cannot be run."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.export.identified_model import IdentifiedModel, identified_model
from scara_ident.identification.identify import identify
from scara_ident.model.model import build_model
from scara_ident.motion.motion import Motion
from scara_ident.motion.recorded_range import RecordedRange
from scara_ident.recording.recording import write_recording
from scara_ident.robot.robot import load_robot
from scara_ident.simulation import ideal, simulate, virtual_arm
from scara_ident.simulation.truth import _complete_parameters
from scara_ident.use.check import check, check_dict, read_motion, slowed
from scara_ident.use.joint_limits import joint_limits
from tests.arms import recording
from tests.simulation.made import swing
from tests.use.made import known_as


@pytest.fixture(scope="module")
def rehearsed(tmp_path_factory: pytest.TempPathFactory):
    """A model identified from one run of the virtual arm, and another run with its true torque."""
    arm = virtual_arm()
    runs = [simulate(arm, swing(arm.robot, 8.0, size, name), rate=500.0) for size, name in ((0.6, "a"), (0.4, "b"))]
    path = tmp_path_factory.mktemp("runs") / "b_1.parquet"
    write_recording(runs[1].recording, path)
    return identified_model(identify(arm.robot, [runs[0].recording], bands=[15.0, 15.0])), runs[1], path


def test_torque_power_and_energy_are_the_virtual_arms_within_5_percent(rehearsed):
    known, run, path = rehearsed
    found = check(known, read_motion(path, known), joint_limits(known.robot))
    (own,) = found.drives
    inside = slice(round(own.motion.time[0] * 500.0), round(own.motion.time[-1] * 500.0) + 1)
    torque = run.true.effort[:, inside]
    # At reversals Coulomb friction jumps and the loop rings for some samples, so the whole is compared, and the peaks.
    peak = np.abs(torque).max(axis=1)
    assert np.abs(own.torque).max(axis=1) == pytest.approx(peak, rel=0.05)
    assert np.all(np.sqrt(np.mean((own.torque - torque) ** 2, axis=1)) < 0.05 * peak)
    assert found.energy.rms_torque == pytest.approx(np.sqrt(np.mean(torque**2, axis=1)), rel=0.05)
    power = torque * run.true.velocity[:, inside] * known.robot.reduction[:, None]
    given, returned = (np.trapezoid(np.maximum(sign * power, 0.0), dx=0.002, axis=1) for sign in (1.0, -1.0))
    assert found.energy.given == pytest.approx(given, rel=0.05)
    assert found.energy.returned == pytest.approx(returned, rel=0.05)
    v, friction = run.true.velocity[:, inside], run.arm.friction
    lost = sum(friction[:, k, None] * np.abs(v) ** (k + 1) for k in range(4)) * np.abs(known.robot.reduction)[:, None]
    assert found.energy.heated == pytest.approx(np.trapezoid(lost, dx=0.002, axis=1), rel=0.05)
    # Noise, and what is missed about reversals.
    assert np.all(found.recorded_rms > run.arm.torque_noise)
    assert np.all(found.recorded_rms < 2.0 * run.arm.torque_noise)


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_torque_and_energy_of_six_and_seven_joints_are_the_virtual_arms_within_5_percent(name: str):
    arm = virtual_arm(load_robot(name))
    model = build_model(arm.robot, "complete")
    known = known_as(model, np.array(_complete_parameters(arm)))
    wanted = swing(arm.robot, 2.5, 0.5)
    time = slice(None, None, 2)
    signals = (getattr(wanted, word)[:, time] for word in ("position", "velocity", "acceleration"))
    found = check(known, [Motion("swing", "swing", wanted.time[time], *signals, None, 500.0)], joint_limits(arm.robot))
    (own,) = found.drives
    # Run as it would be: with that torque fed forward. What the controller adds is what was not foreseen.
    run = simulate(ideal(arm), wanted.at(wanted.time[time]), feed=own.torque, rate=500.0).true
    peak = np.abs(run.effort).max(axis=1)
    assert np.all(np.sqrt(np.mean((own.torque - run.effort) ** 2, axis=1)) < 0.05 * peak)
    assert found.energy.rms_torque == pytest.approx(np.sqrt(np.mean(run.effort**2, axis=1)), rel=0.05)
    power = run.effort * run.velocity / arm.robot.row_scale[:, None]
    assert found.energy.given.sum() == pytest.approx(np.trapezoid(np.maximum(power, 0.0), dx=0.002).sum(), rel=0.05)


def test_peaks_are_within_what_is_stated_of_them_and_unsure_ones_are_named(rehearsed):
    known, run, path = rehearsed
    motions = read_motion(path, known)
    found = check(known, motions, joint_limits(known.robot))
    inside = np.isin(run.recording.time, motions[0].time)
    for j, each in enumerate(found.peaks):
        needed = np.abs(run.true.effort[j, inside]).max()
        assert abs(abs(each.torque) - needed) < 2.0 * each.std
        assert each.std == pytest.approx(np.hypot(each.model_std, known.rms[j]))
        assert 0.0 < each.model_std < 0.01 * needed
        assert check_dict(found)["peaks"][each.joint]["std"] == each.std
    assert not any("no better than" in words for words in check_dict(found)["summary"])
    # Far from what was recorded on joint2, as where the loop rang.
    lost = check(replace(known, rms=known.rms * np.array([1.0, 100.0])), motions, joint_limits(known.robot))
    (said,) = (words for words in check_dict(lost)["summary"] if "uncertain by more than a tenth" in words)
    assert "joint2 (" in said and "joint1" not in said


def test_the_limiting_joint_and_time_are_named(rehearsed):
    known, run, path = rehearsed
    motions = read_motion(path, known)
    seen = run.true.effort[1, np.isin(run.recording.time, motions[0].time)]
    limits = joint_limits(known.robot, torques={"joint1": 2.0, "joint2": 0.8 * np.abs(seen).max()})
    found = check(known, motions, limits)
    worst = found.limited_by
    assert (worst.joint, worst.kind) == ("joint2", "torque")
    assert worst.time == pytest.approx(motions[0].time[np.argmax(np.abs(seen))], abs=0.02)
    assert worst.share == pytest.approx(1.25, rel=0.05)
    content = check_dict(found)
    assert (content["runs"], content["limited_by"]["joint"]) == (False, "joint2")
    assert content["summary"][0].startswith("It cannot be run: torque of joint2 at ")
    # Slower by just so much it can be run.
    share = content["speed_share"]
    assert 0.5 < share < 1.0
    motions = [slowed(each.motion, share) for each in found.drives]
    assert not check(known, motions, limits).broken
    assert check(known, [slowed(each.motion, 1.1 * share) for each in found.drives], limits).broken


def test_a_motion_faster_than_the_recordings_says_so(rehearsed):
    known, _, path = rehearsed
    (motion,) = read_motion(path, known)
    speed = np.max(np.abs(motion.v), axis=1)
    reached = RecordedRange(np.zeros(2), np.zeros(2), speed * [1.0, 0.5], np.zeros(2))
    for each, count in ((replace(known, reached=reached), 1), (replace(known, reached=None), 0)):
        said = [
            line
            for line in check_dict(check(each, [motion], joint_limits(known.robot)))["summary"]
            if "faster than" in line
        ]
        assert len(said) == count
        assert all("joint2" in line and "joint1" not in line for line in said)


def test_what_is_beyond_a_position_limit_cannot_be_run_slower_either(known: IdentifiedModel):
    time = np.linspace(0.0, 2.0, 201)
    zero = np.zeros((2, 201))
    motion = Motion("still", "still", time, zero + 0.5, zero, zero, None, 100.0)
    found = check(known, [motion], joint_limits(known.robot, ranges={"joint1": (-0.1, 0.2)}))
    assert found.speed_share is None
    assert check_dict(found)["summary"][1].endswith(
        "of the speed it cannot be run: position of joint1 is still beyond its limit."
    )
    free = joint_limits(known.robot)
    endless = np.full(2, np.inf)
    free = replace(free, lower=-endless, upper=endless, velocity=endless, torque=endless)
    assert check_dict(check(known, [motion], free))["limited_by"] is None


def test_what_keeps_a_motion_from_being_run_slowly_is_named_as_what_it_is(known: IdentifiedModel):
    """Neither a position nor gravity, but a drive that gives next to nothing."""
    time = np.linspace(0.0, 2.0, 201)
    zero = np.zeros((2, 201))
    motion = Motion("slide", "slide", time, 0.1 * time + zero, zero + 0.1, zero, None, 100.0)
    found = check(known, [motion], joint_limits(known.robot, powers={"joint2": 1e-6}))
    said = check_dict(found)["summary"][1]
    assert said == "Even at 0.02 of the speed it cannot be run: power of joint2 is still beyond its limit."
    assert "position" not in said and "gravity" not in said


def test_a_trajectory_is_taken_as_it_is_and_a_recording_filtered(known: IdentifiedModel, tmp_path: Path):
    arm = virtual_arm()
    made = swing(arm.robot, 2.0)
    shown = recording(arm.robot, "swing", made.time, made.position, None, velocity=made.velocity, acceleration=made.acceleration)  # fmt: skip
    path = tmp_path / "swing.csv"
    write_recording(shown, path)
    (read,) = read_motion(path, known)
    np.testing.assert_allclose(read.a, made.acceleration, rtol=1e-9, atol=1e-12)
    write_recording(replace(shown, velocity=None, acceleration=None), tmp_path / "run.csv")
    (inner,) = read_motion(tmp_path / "run.csv", known)
    start = round(inner.time[0] * 1000.0)
    assert start > 0
    np.testing.assert_allclose(inner.v, made.velocity[:, start : start + inner.samples], atol=2e-2)
