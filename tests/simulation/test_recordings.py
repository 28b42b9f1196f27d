"""What a simulated recording holds, how it is written, and the motions that are asked for."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scara_ident.errors import RecordingError, UsageError
from scara_ident.recording.files.parquet_csv import write_columns
from scara_ident.recording.recording import read_recordings
from scara_ident.simulation import (
    ReferenceMotion,
    parse_effect,
    read_trajectory,
    simulate,
    truth,
    virtual_arm,
    write_simulation,
)
from scara_ident.simulation.loop import velocity_filter
from tests.simulation.made import scara, swing


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


def test_velocity_is_recorded_only_when_asked_for() -> None:
    arm = virtual_arm()
    motion = swing(arm.robot, 1.0)
    assert simulate(arm, motion).recording.velocity is None
    result = simulate(arm, motion, record_velocity=True)
    lag = np.abs(result.recording.velocity - result.true.velocity).max()
    assert 1e-3 < lag < 0.1


def test_velocity_filter_is_critically_damped_at_its_cut_off() -> None:
    b0, b1, b2, a1, a2 = velocity_filter(1000.0, 100.0)
    for frequency in (0.0, 100.0, 250.0):
        z = np.exp(-2j * np.pi * frequency / 1000.0)
        response = (b0 + b1 * z + b2 * z * z) / (1.0 + a1 * z + a2 * z * z)
        warped = np.tan(np.pi * frequency / 1000.0) / np.tan(np.pi * 0.1)
        assert response == pytest.approx(1.0 / (1.0 + 1j * warped) ** 2, abs=1e-12)


def test_written_recordings_are_read_back_and_the_truth_beside_is_not_one(tmp_path: Path) -> None:
    arm = virtual_arm()
    arm = replace(arm, robot=replace(arm.robot, effort_gain=np.array([2.0, 0.5])))
    effect = parse_effect("spring:joint2")
    runs = [simulate(arm, swing(arm.robot, 0.5), effects=[effect], repetition=k) for k in (1, 2)]
    paths = [write_simulation(run, tmp_path / "out") for run in runs]
    assert sorted(p.name for p in (tmp_path / "out").iterdir()) == [
        "swing_1.parquet", "swing_1.truth.json", "swing_2.parquet", "swing_2.truth.json",
    ]  # fmt: skip
    read = read_recordings([tmp_path / "out"], arm.robot)
    assert [item.path for item in read] == paths
    np.testing.assert_allclose(read[1].effort, runs[1].recording.effort, rtol=1e-12)
    np.testing.assert_array_equal(read[1].position, runs[1].recording.position)
    content = json.loads((tmp_path / "out" / "swing_2.truth.json").read_text())
    assert content["repetition"] == 2
    assert content["effects"] == [runs[1].effects[0].as_dict()]
    assert content["effects"][0]["parameters"]["stiffness"] > 0.0


def test_truth_of_the_default_arm_is_the_papers_table_5() -> None:
    values = {row["name"]: row["value"] for row in truth(virtual_arm())["parameters"]}
    printed = {"P_d1": 16.165, "P_d2": 2.415, "P_d4": 0.758, "P_d5": 4.014, "a01": 0.21, "a11": 0.093, "a21": -0.016}
    printed |= {"a02": 0.088, "a12": 0.049, "a22": -0.007, "a31": 0.0, "a32": 0.0, "p_o1": 0.0, "P_d3": 0.0}
    assert {name: values[name] for name in printed} == pytest.approx(printed, abs=1e-9)


def test_a_trajectory_file_is_followed(tmp_path: Path) -> None:
    arm = scara()
    motion = swing(arm.robot, 0.4)
    columns = {"time": motion.time}
    for kind in ("position", "velocity", "acceleration"):
        for joint, row in zip(motion.joints, getattr(motion, kind), strict=True):
            columns[f"{joint}.{kind}"] = row
    write_columns(tmp_path / "swing.csv", columns)
    read = read_trajectory(tmp_path / "swing.csv", arm.robot)
    np.testing.assert_allclose(read.position, motion.position, atol=1e-15)
    assert read.name == "swing"
    del columns["joint2.velocity"]
    write_columns(tmp_path / "part.csv", columns)
    with pytest.raises(RecordingError, match=r"part.csv: no column 'joint2.velocity'"):
        read_trajectory(tmp_path / "part.csv", arm.robot)


def test_a_coarse_motion_is_interpolated_by_quintics() -> None:
    motion = swing(scara().robot, 2.0)
    coarse = ReferenceMotion(
        "c", motion.joints, motion.time[::20],
        motion.position[:, ::20], motion.velocity[:, ::20], motion.acceleration[:, ::20],
    )  # fmt: skip
    fine = coarse.at(motion.time)
    np.testing.assert_allclose(fine.position, motion.position, atol=1e-9)
    np.testing.assert_allclose(fine.velocity, motion.velocity, atol=1e-7)
    np.testing.assert_allclose(fine.acceleration, motion.acceleration, atol=1e-4)


def test_a_held_motion_stands_before_and_after() -> None:
    motion = swing(scara().robot, 0.5).held(0.1, 0.2)
    assert motion.duration == pytest.approx(0.8)
    assert np.all(np.diff(motion.time) > 0)
    assert np.all(motion.velocity[:, :100] == 0.0)
    assert np.all(motion.position[:, -200:] == motion.position[:, -1:])


def test_another_arms_motion_is_refused() -> None:
    motion = replace(swing(scara().robot, 0.5), joints=("a", "b"))
    with pytest.raises(UsageError, match="moves a, b, the arm has joint1, joint2"):
        simulate(scara(), motion)


def test_a_motion_with_a_gap_in_its_values_is_refused() -> None:
    motion = swing(scara().robot, 0.5)
    broken = motion.velocity.copy()
    broken[1, 3] = np.nan
    with pytest.raises(RecordingError, match="velocity has a value that is not finite"):
        replace(motion, velocity=broken)
