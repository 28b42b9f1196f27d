"""Sizes, units, turns, spikes, jumps, limits and joints at rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.errors import RecordingError
from scara_ident.recording.audit.position import is_computed
from tests.made_recordings import COUNT, columns
from tests.recording.audit.made import Read, kinds, only, refusal


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


def test_without_a_gear_stated_degrees_may_be_the_angle_of_a_motor(read, robot):
    """Of a TX40, whose encoders count radians behind gears of 32 to 48, which its URDF does not say."""
    made = columns()
    for joint in ("joint1", "joint2"):
        made[f"{joint}.position"] *= 40.0
    message = refusal(read, made, replace(robot, reduction=np.ones(2)))
    assert "degrees (multiply by pi/180), or it is the motor's angle (state reduction, and side: motor" in message
    assert "or it is the motor's angle" not in refusal(read, made)


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
    assert "limit of 2.182" in finding.message and finding.joint == "joint2"
    assert finding.count == np.count_nonzero(made["joint2.position"] > np.radians(125))
    assert len(recording.time) == 4000


def test_an_angle_recorded_within_one_turn_is_unwrapped(read, robot):
    endless = replace(robot, lower=np.full(2, -np.inf), upper=np.full(2, np.inf))
    made = columns()
    truth = made["joint1.position"] + 1.9
    made["joint1.position"] = np.angle(np.exp(1j * truth))
    recording = read(made, endless)
    finding = only(recording, "wrapped")
    assert finding.joint == "joint1" and finding.message.startswith("joint1.position jumps by a whole turn")
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


def test_over_a_gap_too_short_for_half_a_turn_an_angle_is_unwrapped(read, robot):
    """Refused as 'jumps by 6.01 rad and stays, as after a reset of the encoder': it passed half a turn while samples were lost."""
    endless = replace(robot, lower=np.full(2, -np.inf), upper=np.full(2, np.inf))
    assert np.all(endless.velocity_limit == 3.77)
    made = columns()
    fast = 100 + int(np.argmax(np.abs(np.diff(made["joint1.position"][100:-100]))))
    lost = slice(fast - 10, fast + 10)
    truth = np.delete(made["joint1.position"], lost) + np.pi - made["joint1.position"][fast]
    made = {name: np.delete(values, lost) for name, values in made.items()}
    made["joint1.position"] = np.angle(np.exp(1j * truth))
    step = np.abs(np.diff(made["joint1.position"]))[fast - 11]
    assert 5.5 < step < 6.25
    recording = read(made, endless)
    assert "wrapped" in kinds(recording) and "gap" in kinds(recording)
    np.testing.assert_allclose(recording.position[0] - recording.position[0, 0], truth - truth[0], atol=1e-12)
    # What is left of a step when the turn is taken off has to be a way that the joint can have gone.
    made["joint1.position"][fast - 10 :] -= np.sign(made["joint1.position"][fast - 10]) * 2.0
    with pytest.raises(RecordingError, match="as after a reset of the encoder"):
        read(made, endless)


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


def test_a_joint_that_stands_still_is_said(read):
    made = columns()
    made["joint2.position"] = COUNT * np.random.default_rng(3).integers(-3, 4, 4000).astype(float)
    finding = only(read(made), "idle_joint")
    assert finding.count == 1
    assert finding.message.startswith("joint2 does not move")


@pytest.mark.parametrize("rows", [slice(None, None, 2), slice(600, None)], ids=["every other", "half a file"])
@pytest.mark.parametrize("signal", ["position", "effort"])
def test_numbers_that_no_channel_gives_are_refused(read: Read, signal: str, rows: slice):
    made = columns(1200)
    made[f"joint2.{signal}"][rows] = -1e29
    said = refusal(read, made)
    assert f"joint2.{signal} is -1e+29 in row {(rows.start or 0) + 1} " in said
    assert (
        f"in {np.count_nonzero(made[f'joint2.{signal}'] == -1e29)} of 1200 rows; check the type of its numbers" in said
    )


@pytest.mark.parametrize("signal", ["position", "effort"])
def test_a_single_one_is_left_out(read: Read, signal: str):
    made = columns(1200)
    made[f"joint2.{signal}"][700] = 1e29
    recording = read(made)
    assert "row 701" in only(recording, "spike").message
    assert len(recording.time) == 1199


def test_positions_smoother_than_any_encoder_beside_noisy_efforts_are_said_to_be_computed(read, robot):
    def told(samples: int, interval: float, step: float) -> dict[str, np.ndarray]:
        made, time = columns(samples, interval), interval * np.arange(samples)
        for joint, (middle, amplitude, frequency) in {"joint1": (1.5, 1.2, 0.35), "joint2": (0.1, 1.0, 1.5)}.items():
            exact = middle + amplitude * np.sin(2 * np.pi * frequency * time)
            made[f"{joint}.position"] = step * np.rint(exact / step) if step else exact
        return made

    for samples, interval in ((4000, 1e-3), (1000, 8e-3)):
        finding = only(read(told(samples, interval, 0.0)), "computed_position")
        assert finding.count == 2
        assert "neither noise nor an encoder's steps" in finding.message
        assert "log the measured positions" in finding.message
        # 24 bits on the motor, before a gear of 160.
        assert read(told(samples, interval, 2 * np.pi / 2**24 / 160)).findings == ()
    # A plan has no efforts, and a simulator without noise in anything is none that anybody takes for an arm.
    made = told(4000, 1e-3, 0.0)
    for joint in ("joint1", "joint2"):
        made[f"{joint}.effort"] = np.gradient(np.gradient(made[f"{joint}.position"]))
    assert read(made).findings == ()


def test_a_joint_that_rests_on_its_encoder_is_measured():
    position = COUNT * np.rint(np.repeat([0.0, 1.0], 500) / COUNT)
    assert not is_computed(position)
    assert not is_computed(np.linspace(0.0, 1.0, 50))
    assert is_computed(np.linspace(0.0, 1.0, 500) ** 2)
