from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from time import perf_counter

import numpy as np
import pytest

from scara_ident.errors import RecordingError
from scara_ident.recording.audit import Samples, audit
from scara_ident.recording.recording import Recording, read_recording, read_recordings
from scara_ident.robot.robot import Robot, load_robot
from tests.made_recordings import COUNT, columns, save
from tests.shared import shared_path

Read = Callable[..., Recording]


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


@pytest.fixture
def read(tmp_path: Path, robot: Robot) -> Read:
    def reader(made: dict[str, np.ndarray], other: Robot | None = None, **options: bool) -> Recording:
        return read_recording(save(tmp_path / "run_1.parquet", made), other or robot, **options)

    return reader


def refusal(read: Read, made: dict[str, np.ndarray], other: Robot | None = None) -> str:
    with pytest.raises(RecordingError) as caught:
        read(made, other)
    message = str(caught.value)
    assert "\n" not in message
    assert "run_1.parquet" in message
    return message


def kinds(recording: Recording) -> list[str]:
    return [finding.kind for finding in recording.findings]


def only(recording: Recording, kind: str):
    assert kinds(recording) == [kind]
    finding = recording.findings[0]
    assert "\n" not in finding.message
    return finding


def rows(made: dict[str, np.ndarray], index: np.ndarray) -> dict[str, np.ndarray]:
    return {name: values[index] for name, values in made.items()}


def test_a_faultless_recording_has_no_findings_and_keeps_every_sample(read):
    made = columns()
    recording = read(made)
    assert recording.findings == ()
    np.testing.assert_array_equal(recording.time, made["time"])
    np.testing.assert_array_equal(recording.position[1], made["joint2.position"])
    np.testing.assert_array_equal(recording.effort[0], made["joint1.effort"])


# numbers that are missing


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("column", ["time", "joint1.position", "joint2.effort"])
def test_scattered_rows_without_a_number_are_left_out_and_said(read, column, wrong):
    made = columns()
    made[column][[99, 500, 501, 3000]] = wrong
    recording = read(made)
    finding = only(recording, "nan")
    assert finding.count == 4
    assert f"{column} is empty, NaN or infinite in 4 of 4000 rows, first in row 100" in finding.message
    np.testing.assert_array_equal(recording.effort[0], np.delete(made["joint1.effort"], [99, 500, 501, 3000]))


def test_infinities_of_both_signs_do_not_hide_each_other(read):
    made = columns()
    made["joint1.effort"][10], made["joint1.effort"][20] = np.inf, -np.inf
    assert only(read(made), "nan").count == 2


def test_many_missing_numbers_are_refused_by_column_count_and_row(read):
    made = columns()
    made["joint2.position"][1000::30] = np.nan
    message = refusal(read, made)
    assert "joint2.position" in message
    assert "100 of 4000" in message
    assert "first in row 1001" in message


def test_a_run_of_missing_numbers_is_refused_inside_and_cut_off_at_the_ends(read):
    made = columns()
    made["joint1.effort"][2000:2015] = np.nan
    message = refusal(read, made)
    assert "15 rows in a row" in message
    assert "row 2001" in message
    made = columns()
    made["joint1.effort"][:20] = np.nan
    made["joint1.effort"][-15:] = np.nan
    recording = read(made)
    assert only(recording, "nan").count == 35
    assert len(recording.time) == 3965


def test_missing_numbers_of_an_optional_column_leave_that_column_out(read):
    made = columns()
    for joint in ("joint1", "joint2"):
        made[f"{joint}.velocity"] = np.gradient(made[f"{joint}.position"], 1e-3)
    made["joint2.velocity"][6] = np.nan
    recording = read(made)
    finding = only(recording, "nan")
    assert "joint2.velocity" in finding.message
    assert "row 7" in finding.message
    assert recording.velocity is None
    assert len(recording.time) == 4000


def test_an_optional_column_survives_where_its_missing_rows_are_left_out_anyway(read):
    made = columns()
    for joint in ("joint1", "joint2"):
        made[f"{joint}.velocity"] = np.gradient(made[f"{joint}.position"], 1e-3)
    made["joint2.velocity"][-1] = made["joint2.effort"][-1] = np.nan
    recording = read(made)
    assert kinds(recording) == ["nan"]
    np.testing.assert_array_equal(recording.velocity[1], made["joint2.velocity"][:-1])


# samples and clock


@pytest.mark.parametrize("samples", [0, 1, 2, 49])
def test_too_few_samples_are_refused(read, samples):
    assert f"{samples} usable samples; at least 50" in refusal(read, columns(samples))


def test_fifty_samples_are_enough(read):
    assert len(read(columns(50, 0.05)).time) == 50


@pytest.mark.parametrize(
    ("factor", "interval", "looks"),
    [
        (1e3, 1e-3, "milliseconds"),
        (1e3, 1e-2, "milliseconds"),
        (1e6, 1e-3, "microseconds"),
        (1e6, 1.25e-4, "microseconds"),
        (1e9, 2e-3, "nanoseconds"),
        (1 / 3600, 1e-3, "write it in seconds"),
    ],
)
def test_time_in_another_unit_is_refused_with_the_unit_it_looks_like(read, factor, interval, looks):
    made = columns(interval=interval)
    made["time"] *= factor
    assert looks in refusal(read, made)


def test_time_that_runs_backwards_is_refused_by_row(read):
    made = columns()
    made["time"][2500:] -= 1.0
    message = refusal(read, made)
    assert "backwards at row 2501" in message
    assert "from 2.499 s to 1.5 s" in message
    assert "1 time in all" in message


def test_rows_written_twice_are_dropped(read):
    made = columns()
    twice = rows(made, np.sort(np.concatenate([np.arange(4000), np.arange(4000)])))
    recording = read(twice)
    finding = only(recording, "repeated_time")
    assert finding.count == 4000
    assert "same values" in finding.message
    np.testing.assert_array_equal(recording.position[0], made["joint1.position"])


def test_of_differing_rows_of_one_time_the_first_is_kept(read):
    made = columns()
    made["time"][[7, 8, 300]] = made["time"][[6, 6, 299]]
    recording = read(made)
    finding = only(recording, "repeated_time")
    assert finding.count == 3
    assert "3 with other values" in finding.message
    assert "row 8" in finding.message
    np.testing.assert_array_equal(recording.effort[0], np.delete(made["joint1.effort"], [7, 8, 300]))


def test_a_clock_too_coarse_for_the_rate_is_refused(read):
    made = columns()
    made["time"] = np.floor(made["time"] / 3e-3) * 3e-3
    message = refusal(read, made)
    assert "clock is too coarse" in message
    assert "row 2 " in message


def test_time_that_never_advances_is_refused(read):
    made = columns()
    made["time"][:] = 5.0
    assert "never advances" in refusal(read, made)


def test_jitter_is_said_with_its_size(read):
    made = columns()
    made["time"] += 1e-3 * np.random.default_rng(1).uniform(-0.2, 0.2, 4000)
    finding = only(read(made), "jitter")
    # The difference of two uniform deviates of half-width 0.2 has a standard deviation of 0.2 sqrt(2/3).
    assert "varies by 16 %" in finding.message


def test_the_jitter_of_a_steady_clock_is_not_worth_a_line(read):
    made = columns()
    made["time"] += 1e-3 * np.random.default_rng(1).uniform(-0.02, 0.02, 4000)
    assert read(made).findings == ()


def test_lost_samples_and_gaps_are_counted_and_placed(read):
    made = columns()
    lost = np.concatenate([[100, 900, 1700, 1701], np.arange(2500, 2750)])
    recording = read(rows(made, np.delete(np.arange(4000), lost)))
    dropped, gap = recording.findings
    assert (dropped.kind, dropped.count) == ("dropped", 4)
    assert "row 101 (0.101 s)" in dropped.message
    assert (gap.kind, gap.count) == ("gap", 1)
    assert "0.251 s" in gap.message
    assert "(2.75 s)" in gap.message
    assert "about 250 samples" in gap.message
    assert len(recording.time) == 4000 - 254


# rows that repeat


@pytest.mark.parametrize("hold", [2, 5])
def test_a_logger_faster_than_its_source_is_thinned_to_the_source(read, hold):
    made = columns()
    held = {n: (v if n == "time" else v[np.arange(4000) // hold * hold]) for n, v in made.items()}
    recording = read(held)
    finding = only(recording, "held_samples")
    assert finding.count == 4000 - 4000 // hold
    assert recording.rate == pytest.approx(1000 / hold)
    np.testing.assert_array_equal(recording.effort[1], made["joint2.effort"][::hold])


def test_scattered_held_rows_are_left_out(read):
    made = columns()
    late = np.sort(np.random.default_rng(2).choice(np.arange(1, 4000), 300, replace=False))
    for name, values in made.items():
        if name != "time":
            for i in late:
                values[i] = values[i - 1]
    finding = only(read(made), "held_samples")
    assert finding.count == 300


def test_a_stalled_logger_leaves_a_gap(read):
    made = columns()
    for name, values in made.items():
        if name != "time":
            values[1000:1300] = values[1000]
    recording = read(made)
    finding = only(recording, "freeze")
    assert finding.count == 299
    assert "row 1001" in finding.message
    assert np.max(np.diff(recording.time)) == pytest.approx(0.3)


def test_quantised_slow_motion_with_quantised_effort_is_not_called_held(read):
    made = columns(interval=2e-3)
    for name, values in made.items():
        if name.endswith("effort"):
            values[:] = 0.02 * np.rint(values / 0.02)
        elif name.endswith("position"):
            values[:] = 0.01 * np.rint(values / 0.01)
    same = np.all([np.diff(v) == 0 for n, v in made.items() if n != "time"], axis=0)
    assert same.mean() > 0.02
    assert read(made).findings == ()


def test_an_arm_that_rests_between_motions_without_noise_is_not_called_held_or_frozen(read):
    time = 1e-3 * np.arange(6000)
    s = np.clip(np.concatenate([np.linspace(0, 1, 2000), np.ones(1000), np.linspace(1, 0, 2000), np.zeros(1000)]), 0, 1)
    smooth = 10 * s**3 - 15 * s**4 + 6 * s**5
    force = np.gradient(np.gradient(smooth, 1e-3), 1e-3)
    made = {"time": time}
    for joint in ("joint1", "joint2"):
        made[f"{joint}.position"], made[f"{joint}.effort"] = 0.5 + smooth, 0.1 * force
    assert read(made).findings == ()


# units, limits and turns


@pytest.mark.parametrize(
    ("factor", "looks"),
    [
        (180 / np.pi, "degrees (multiply by pi/180)"),
        (100.0, "the motor's angle (divide by the reduction 100)"),
        (100 * 180 / np.pi, "the motor's degrees (multiply by pi/180, divide by the reduction 100)"),
    ],
)
def test_positions_in_another_unit_are_refused_with_the_unit_they_look_like(read, factor, looks):
    made = columns()
    made["joint1.position"] *= factor
    made["joint2.position"] *= factor
    message = refusal(read, made)
    assert looks in message
    assert "joint1.position (and joint2.position)" in message
    assert "limits -0.6109 to 3.752 rad" in message


def test_motor_turns_and_a_single_joint_in_degrees_are_seen(read):
    made = columns()
    made["joint2.position"] *= 100 / (2 * np.pi)
    assert "the motor's turns (multiply by 2 pi" in refusal(read, made)
    made = columns()
    made["joint2.position"] *= 180 / np.pi
    message = refusal(read, made)
    assert "degrees" in message
    assert "joint1.position" not in message


def test_encoder_counts_are_refused_as_such(read):
    made = columns()
    for joint in ("joint1", "joint2"):
        made[f"{joint}.position"] = np.rint(made[f"{joint}.position"] / COUNT)
    assert "encoder counts" in refusal(read, made)


def test_an_angle_that_is_whole_turns_off_is_refused(read):
    made = columns()
    made["joint1.position"] -= 2 * np.pi
    message = refusal(read, made)
    assert "whole turns off (add 1 x 2 pi)" in message


def test_a_prismatic_axis_in_millimetres_is_refused(read, robot):
    slide = replace(robot, prismatic=np.array([True, False]), lower=np.array([-0.1, -2.2]), upper=np.array([3.0, 2.2]))
    made = columns()
    made["joint1.position"] *= 1000
    assert "millimetres (divide by 1000)" in refusal(read, made, slide)


def test_units_are_judged_by_speed_where_a_joint_has_no_limits(read, robot):
    endless = replace(robot, lower=np.full(2, -np.inf), upper=np.full(2, np.inf))
    made = columns()
    assert read(made, endless).findings == ()
    made["joint1.position"] *= 180 / np.pi
    message = refusal(read, made, endless)
    assert "moves at" in message
    assert "limit 3.77 rad/s" in message
    assert "degrees" in message


def test_counts_are_seen_without_any_limit(read, robot):
    bare = replace(robot, lower=np.full(2, -np.inf), upper=np.full(2, np.inf), velocity_limit=np.full(2, np.inf))
    made = columns()
    assert read(made, bare).findings == ()
    made["joint1.position"] = np.rint(made["joint1.position"] / COUNT)
    assert "encoder counts" in refusal(read, made, bare)


def test_limits_of_zero_bound_nothing(read, robot):
    dummy = replace(robot, lower=np.zeros(2), upper=np.zeros(2), velocity_limit=np.zeros(2))
    assert read(columns(), dummy).findings == ()


def test_positions_a_little_beyond_the_limits_are_used_and_said(read):
    made = columns()
    made["joint2.position"] += 1.25
    recording = read(made)
    finding = only(recording, "limits")
    assert "joint2.position reaches 2.35 rad" in finding.message
    assert "limit of 2.182" in finding.message
    assert finding.count == np.count_nonzero(made["joint2.position"] > np.radians(125))
    assert len(recording.time) == 4000


def test_an_angle_recorded_within_one_turn_is_unwrapped(read, robot):
    endless = replace(robot, lower=np.full(2, -np.inf), upper=np.full(2, np.inf))
    made = columns()
    truth = made["joint1.position"] + 1.9
    made["joint1.position"] = np.angle(np.exp(1j * truth))
    recording = read(made, endless)
    finding = only(recording, "wrapped")
    assert finding.count == np.count_nonzero(np.abs(np.diff(made["joint1.position"])) > 3)
    np.testing.assert_allclose(recording.position[0] - recording.position[0, 0], truth - truth[0], atol=1e-12)


def test_over_a_gap_an_arm_may_turn(read, robot):
    endless = replace(robot, lower=np.full(2, -np.inf), upper=np.full(2, np.inf))
    made = columns()
    for values in made.values():
        values[2000:] += 6.4
    recording = read(made, endless)
    assert only(recording, "gap").count == 1
    np.testing.assert_array_equal(recording.position[0], made["joint1.position"])


# spikes and jumps


def test_a_few_wild_positions_are_left_out_and_said(read):
    made = columns()
    wild = [17, 1200, 1201, 3999]
    made["joint1.position"][wild] += [0.7, -0.4, 0.9, 1.1]
    made["joint2.position"][2222] = 1e6
    recording = read(made)
    finding = only(recording, "spike")
    assert finding.count == 5
    assert "joint1.position has 4 wild samples" in finding.message
    assert "row 18" in finding.message
    np.testing.assert_array_equal(recording.time, np.delete(made["time"], [*wild, 2222]))


def test_wild_positions_are_seen_without_a_velocity_limit(read, robot):
    bare = replace(robot, velocity_limit=np.full(2, np.inf))
    made = columns()
    made["joint1.position"][1234] = 0.0
    assert only(read(made, bare), "spike").count == 1


def test_a_position_far_off_the_arms_own_speed_is_wild_even_where_the_limit_allows_it(read, robot):
    fast = replace(robot, velocity_limit=np.full(2, 20.0))
    made = columns()
    made["joint2.position"][1234] += 0.1
    assert only(read(made, fast), "spike").count == 1


@pytest.mark.parametrize("limit", [3.77, np.inf])
def test_the_flicker_of_a_coarse_encoder_is_not_wild(read, robot, limit):
    made = columns()
    random = np.random.default_rng(4)
    for joint, resting in (("joint1", True), ("joint2", False)):
        position = np.full(4000, 0.4) if resting else made[f"{joint}.position"]
        made[f"{joint}.position"] = 0.005 * np.rint((position + 0.001 * random.standard_normal(4000)) / 0.005)
    made["joint1.position"][::100] += 0.005
    assert "spike" not in kinds(read(made, replace(robot, velocity_limit=np.full(2, limit))))


def test_many_wild_positions_are_refused(read):
    made = columns()
    made["joint2.position"][5::80] += 0.5
    message = refusal(read, made)
    assert "joint2.position has 50 wild samples" in message
    assert "row 6" in message


def test_a_position_that_jumps_and_stays_is_refused(read):
    made = columns()
    made["joint2.position"][3000:] += 0.3
    message = refusal(read, made)
    assert "joint2.position jumps by 0.298" in message
    assert "row 3001" in message


# joints that stand still, dead and saturated efforts


def test_a_joint_that_stands_still_is_said(read):
    made = columns()
    made["joint2.position"] = COUNT * np.random.default_rng(3).integers(-3, 4, 4000).astype(float)
    finding = only(read(made), "idle_joint")
    assert finding.count == 1
    assert finding.message.startswith("joint2 does not move")


@pytest.mark.parametrize("value", [0.0, 0.173])
def test_a_dead_effort_of_a_moving_joint_is_refused(read, value):
    made = columns()
    made["joint2.effort"][:] = value
    message = refusal(read, made)
    assert f"joint2.effort is {value:g} throughout" in message
    assert "dead" in message


def test_a_dead_effort_is_no_matter_where_the_joint_stands_still_or_efforts_are_not_needed(read):
    made = columns()
    made["joint2.effort"][:] = 0.0
    assert read(made, need_effort=False).findings == ()
    made["joint2.position"][:] = 0.4
    assert kinds(read(made)) == ["idle_joint", "dead_effort"]


def test_an_effort_that_dies_is_left_out_or_refused_with_its_place(read):
    made = columns()
    made["joint1.effort"][3000:] = 0.1
    recording = read(made)
    finding = only(recording, "stuck_effort")
    assert finding.count == 1000
    assert "row 3001" in finding.message
    assert len(recording.time) == 3000
    made["joint1.effort"][1500:] = 0.1
    assert "row 1501" in refusal(read, made)


def test_saturation_is_said_with_share_and_level(read, robot):
    made = columns()
    made["joint1.effort"] = np.clip(made["joint1.effort"], -10.0, 0.3)
    share = np.mean(made["joint1.effort"] == 0.3)
    recording = read(made, replace(robot, effort_gain=np.array([2.0, 1.0])))
    finding = only(recording, "saturation")
    assert finding.count == np.count_nonzero(made["joint1.effort"] == 0.3)
    assert "extreme 0.3 (0.6 N m)" in finding.message
    assert f"{100 * share:.2g} %" in finding.message
    made["joint1.effort"] = np.clip(made["joint1.effort"], -0.35, 0.3)
    assert kinds(read(made)) == ["saturation", "saturation"]


def test_the_crests_of_a_quantised_effort_are_not_called_saturation(read):
    made = columns()
    phase = 2 * np.pi * 0.35 * made["time"]
    made["joint1.effort"] = 0.01 * np.rint(0.4 * np.cos(phase) / 0.01)
    assert "saturation" not in kinds(read(made))
    made["joint1.effort"] = 0.01 * np.rint(columns()["joint1.effort"] / 0.01)
    assert "saturation" not in kinds(read(made))


# everything at once


def test_faults_add_up_and_rows_are_named_as_in_the_file(read):
    made = columns()
    made["joint1.effort"][10] = np.nan
    made["time"][20] = made["time"][19]
    made["joint2.position"][30] += 1.0
    made["joint1.position"] += 0.2
    recording = read(made)
    assert kinds(recording) == ["nan", "repeated_time", "spike"]
    assert "row 11" in recording.findings[0].message
    assert "row 21" in recording.findings[1].message
    assert "row 31" in recording.findings[2].message
    np.testing.assert_array_equal(recording.time, np.delete(made["time"], [10, 20, 30]))
    np.testing.assert_array_equal(recording.effort[1], np.delete(made["joint2.effort"], [10, 20, 30]))


def test_the_audit_leaves_the_samples_it_was_given_alone(robot):
    made = columns()
    made["joint1.position"][1234] += 1.0
    position = np.array([made["joint1.position"], made["joint2.position"]])
    effort = np.array([made["joint1.effort"], made["joint2.effort"]])
    before = [made["time"].copy(), position.copy(), effort.copy()]
    audit(Samples("run", robot, made["time"], position, effort, np.arange(1, 4001)))
    for array, copy in zip((made["time"], position, effort), before, strict=True):
        np.testing.assert_array_equal(array, copy)


def test_the_audit_of_25_seconds_at_1_khz_is_a_matter_of_milliseconds(robot):
    made = columns(25000)
    samples = Samples(
        "run",
        robot,
        made["time"],
        np.array([made["joint1.position"], made["joint2.position"]]),
        np.array([made["joint1.effort"], made["joint2.effort"]]),
        np.arange(1, 25001),
    )
    lasting = []
    for _ in range(5):
        start = perf_counter()
        audit(samples)
        lasting.append(perf_counter() - start)
    # Measured 3 ms; the bound leaves room for a machine that is busy with other things.
    assert min(lasting) < 0.03


# measured recordings: every finding was checked by eye against the file


@pytest.mark.parametrize(
    ("folder", "count", "expected"),
    [
        ("emps", 2, set()),
        ("ur10e", 13, {"jitter", "idle_joint"}),
        ("double_pendulum_c1", 10, {"dropped", "idle_joint"}),
        ("double_pendulum_a0", 9, {"dropped", "jitter", "limits"}),
    ],
)
def test_measured_recordings_are_read_with_few_and_true_findings(folder, count, expected):
    arm = load_robot(shared_path("data", folder, "robot.yaml"))
    recordings = read_recordings([shared_path("data", folder)], arm)
    assert len(recordings) == count
    seen = {finding.kind for recording in recordings for finding in recording.findings}
    assert seen <= expected
    assert all(len(recording.findings) <= 2 for recording in recordings)


def test_of_the_joints_of_a_jointwise_run_only_the_one_that_moves_is_not_idle():
    arm = load_robot(shared_path("data", "ur10e", "robot.yaml"))
    recording = read_recording(shared_path("data", "ur10e", "jointwise_1.parquet"), arm)
    idle = next(finding for finding in recording.findings if finding.kind == "idle_joint")
    assert idle.count == 5
    assert "shoulder_pan_joint" not in idle.message


def test_measured_recordings_in_degrees_are_refused(tmp_path):
    import polars as pl

    arm = load_robot(shared_path("data", "ur10e", "robot.yaml"))
    frame = pl.read_parquet(shared_path("data", "ur10e", "ident_40s_12harm.parquet"))
    path = tmp_path / "degrees.parquet"
    frame.with_columns(pl.col(f"{joint}.position") * 180 / np.pi for joint in arm.joints).write_parquet(path)
    with pytest.raises(RecordingError, match="degrees"):
        read_recording(path, arm)


def test_the_cases_are_read_without_a_finding(robot):
    folders = sorted(shared_path("cases").glob("*/train"))
    for folder in folders:
        for recording in read_recordings([folder], robot):
            assert recording.findings == ()
