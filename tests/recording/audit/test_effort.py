"""Dead, stuck and saturated efforts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.motion.motion import stretches
from tests.made_recordings import columns
from tests.recording.audit.made import kinds, only, refusal


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


def test_an_effort_that_dies_is_left_out_with_its_place(read):
    made = columns()
    made["joint1.effort"][3000:] = 0.1
    recording = read(made)
    finding = only(recording, "stuck_effort")
    assert finding.count == 1000
    assert "row 3001" in finding.message
    assert len(recording.time) == 3000


def test_an_effort_that_is_dead_most_of_the_time_costs_its_joint_alone(read, robot):
    """One dead current cost the other seven joints of an arm their recording."""
    made = columns()
    made["joint1.effort"][1500:] = 0.1
    recording = read(made, replace(robot, effort_gain=np.array([2.0, 1.0])))
    finding = only(recording, "stuck_effort")
    assert "row 1501" in finding.message
    assert "left out of the fit of joint1, wherever it is 0.1" in finding.message
    assert finding.clipped == (0, 0.2)
    assert len(recording.time) == len(made["time"])
    (stretch,) = stretches(recording)
    assert not isinstance(stretch.clipped, bool)
    assert np.all(stretch.clipped[0, 1500:])
    assert not np.any(stretch.clipped[1])


def test_an_effort_that_is_dead_most_of_the_time_is_refused_where_no_other_joint_is_whole(read):
    made = columns()
    made["joint1.effort"][1500:] = 0.1
    made["joint2.position"][:] = 0.4
    assert "row 1501" in refusal(read, made)
    made = columns()
    made["joint1.effort"][1500:2800], made["joint1.effort"][2800:] = 0.1, 0.12
    assert "cut the file there" in refusal(read, made)


@pytest.mark.parametrize(("dead", "said"), [(2400, True), (500, False)])
def test_a_coarse_effort_that_dies_is_recognised_by_how_much_longer_it_lasts_than_any_other(
    read, dead: int, said: bool
):
    """Of 17 values one that lasted for 55 % of the time was believed, and the joint's inertia was 6.6 instead of 16.1."""
    made = columns()
    made["joint1.effort"] = 0.1 * np.round(made["joint1.effort"] / 0.1)
    made["joint1.effort"][len(made["time"]) - dead :] = 0.0
    assert ("stuck_effort" in kinds(read(made))) is said


def slow(stuck: int) -> dict[str, np.ndarray]:
    """Columns of 60 s at 10 Hz, the first effort rounded to steps like its noise, and stuck for some samples."""
    made = {"time": 0.1 * np.arange(600)}
    for k, joint in enumerate(("joint1", "joint2")):
        made[f"{joint}.position"] = 0.8 * np.sin((0.5 + 0.2 * k) * made["time"])
        made[f"{joint}.effort"] = 0.3 * np.cos((0.5 + 0.2 * k) * made["time"])
    noise = np.random.default_rng(1).standard_normal((2, 600))
    made["joint2.effort"] += 0.01 * noise[1]
    made["joint1.effort"] = np.round(made["joint1.effort"] + 0.01 * noise[0], 2)
    made["joint1.effort"][100 : 100 + stuck] = made["joint1.effort"][100]
    return made


def test_what_lasts_by_chance_where_an_effort_is_rounded_is_not_stuck(read):
    """Thirteen notes of four rows each stood where nothing was stuck, and good rows were left out."""
    same = np.diff(slow(0)["joint1.effort"]) == 0.0
    # There are runs longer than the 0.2 s that elsewhere say it all.
    assert np.any(same[2:] & same[1:-1] & same[:-2])
    assert "stuck_effort" not in kinds(read(slow(0)))
    assert [item.count for item in read(slow(15)).findings if item.kind == "stuck_effort"] == [15]


def cruising(digits: int) -> dict[str, np.ndarray]:
    """Columns of a simulator: joints in turn speed up, keep their speed and slow down; the second one pulls at the first."""
    ramp = np.sin(np.linspace(0.0, np.pi / 2.0, 150)) ** 2
    speed = np.concatenate([np.zeros(40), ramp, np.ones(400), ramp[::-1]])
    still = np.zeros_like(speed)
    made = {"time": 0.002 * np.arange(8 * len(speed))}
    for joint, turns in {"joint1": (1, 0, -1, 0), "joint2": (0, 1, 0, -1)}.items():
        v = np.concatenate([turn * speed if turn else still for turn in turns * 2])
        made[f"{joint}.position"] = np.round(0.3 + 0.002 * np.cumsum(v), 9)
        made[f"{joint}.effort"] = 0.2 * np.sign(v) + 0.05 * v + 0.1 * np.gradient(v, 0.002)
    other = np.gradient(made["joint2.position"], 0.002)
    made["joint1.effort"] += 0.1 * np.sin(made["joint2.position"]) * np.round(other, 6) ** 2
    for joint in ("joint1", "joint2"):
        made[f"{joint}.effort"] = np.round(made[f"{joint}.effort"], digits)
    return made


@pytest.mark.parametrize("digits", [4, 15])
def test_the_effort_of_a_simulator_lasts_while_all_joints_keep_their_speed(read, digits: int):
    """All that friction shows was left out as stuck."""
    assert read(cruising(digits)).findings == ()


def test_what_lasts_while_joints_speed_up_or_beside_noise_is_stuck_in_a_simulator_too(read):
    made = cruising(15)
    made["joint1.effort"][100:400] = 0.0
    assert "joint1.effort is stuck at 0 from row 101" in only(read(made), "stuck_effort").message
    made = cruising(15)
    made["joint1.effort"] += 1e-3 * np.random.default_rng(0).standard_normal(len(made["time"]))
    made["joint1.effort"][250:450] = made["joint1.effort"][250]
    assert "from row 251" in only(read(made), "stuck_effort").message


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_an_effort_that_stands_twice_is_refused(read, sign):
    made = columns()
    made["joint2.effort"] = sign * made["joint1.effort"]
    assert "joint2.effort has the numbers of joint1.effort in every row" in refusal(read, made)
    made["joint2.effort"][7] += 0.1
    assert read(made).findings == ()


def test_efforts_that_are_dead_most_of_the_time_are_no_copies(read):
    """Of a TIAGo's wrist, whose two motors read 0 in 98 % of the rows and the same size in the others."""
    made = columns()
    alive = np.arange(len(made["time"])) % 60 == 0
    for joint, sign in {"joint1": 1.0, "joint2": -1.0}.items():
        made[f"{joint}.effort"] = np.where(alive, sign * made["joint1.effort"], 0.0)
    assert read(made).effort is not None


def test_saturation_is_said_with_share_and_level(read, robot):
    made = columns()
    made["joint1.effort"] = np.clip(made["joint1.effort"], -10.0, 0.3)
    share = np.mean(made["joint1.effort"] == 0.3)
    recording = read(made, replace(robot, effort_gain=np.array([2.0, 1.0])))
    finding = only(recording, "saturation")
    assert finding.count == np.count_nonzero(made["joint1.effort"] == 0.3)
    assert "extreme 0.3 (0.6 N m)" in finding.message
    assert finding.clipped == (0, 0.6)
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


@pytest.mark.parametrize(("levels", "said"), [(9, True), (60, False)])
def test_an_effort_of_few_values_is_said(read, levels: int, said: bool):
    """What rounding of 7 values left was `unexplained`, and nothing was said of it."""
    made = columns()
    rng = np.random.default_rng(1)
    step = 2.0 * np.max(np.abs(made["joint2.effort"])) / (levels - 1)
    noisy = made["joint2.effort"] + 0.05 * step * rng.standard_normal(len(made["joint2.effort"]))
    made["joint2.effort"][:] = step * np.round(noisy / step)
    findings = [item for item in read(made).findings if item.kind == "coarse_effort"]
    assert bool(findings) is said
    if said:
        assert findings[0].message.startswith("joint2.effort takes") and findings[0].joint == "joint2"
        assert f"values only, {step:.3g} N m apart" in findings[0].message


def test_values_that_differ_by_rounding_alone_are_one(read):
    """0.014 and 0.013999999999999999 were two values, 3.57e-17 N m apart."""
    made = columns()
    step = np.max(np.abs(made["joint2.effort"])) / 7.0
    counts = np.round(made["joint2.effort"] / step)
    made["joint2.effort"][:] = np.where(
        np.arange(len(counts)) % 3 == 0, counts * step, counts * step * (1.0 - 1e-16 * 2)
    )
    (finding,) = [item for item in read(made).findings if item.kind == "coarse_effort"]
    assert f"takes {len(np.unique(counts))} values only, {step:.3g} N m apart" in finding.message
