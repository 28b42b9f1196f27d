"""Samples lost under an even clock are seen by the motion; noise, coarse encoders and real jerks are not taken for it."""

from __future__ import annotations

import re

import numpy as np
import pytest

from scara_ident.errors import RecordingError
from scara_ident.recording.audit import Samples
from scara_ident.recording.audit.lost_samples import restamped
from scara_ident.robot.robot import load_robot

ROBOT = load_robot()
INTERVAL = 2e-3


def moved(seed: int = 0, count: int = 6000, lost: float = 0.0, step: float = 1e-5, jolts: int = 0) -> Samples:
    """Two joints on sines and noise, of which a share of samples is lost; the clock is even."""
    random = np.random.default_rng(seed)
    time = INTERVAL * np.arange(count)
    position = np.array([np.sin(2.1 * time + 0.3), 0.8 * np.sin(3.3 * time) + 0.2 * np.cos(5.1 * time)])
    # The speed changes at once, as at a stop or with a push.
    for at in random.uniform(0.0, time[-1], jolts):
        position += random.normal(0.0, 0.5, (2, 1)) * np.maximum(time - at, 0.0)
    if step:
        position = step * np.rint((position + 0.3 * step * random.standard_normal(position.shape)) / step)
    kept = random.random(count) >= lost
    rows = np.arange(1, np.count_nonzero(kept) + 1)
    return Samples("a.csv", ROBOT, INTERVAL * rows, position[:, kept], None, rows)


@pytest.mark.parametrize("lost", [0.02, 0.05, 0.1])
@pytest.mark.parametrize("step", [0.0, 1e-5, 1e-4])
def test_many_lost_samples_are_refused_with_their_share(lost: float, step: float):
    with pytest.raises(RecordingError, match="samples are lost, but the clock is even") as caught:
        restamped(moved(lost=lost, step=step))
    share = re.search(r"in ([0-9.]+) % of the steps", str(caught.value))
    assert share is not None
    # Two losses close to each other are taken for none or one.
    assert 60 * lost < float(share[1]) < 110 * lost
    assert "\n" not in str(caught.value)


def test_few_lost_samples_are_said():
    samples, (finding,) = restamped(moved(lost=0.005))
    assert finding.kind == "restamped"
    assert 15 <= finding.count <= 40
    assert samples.count > 5900


@pytest.mark.parametrize("bits", range(10, 21, 2))
@pytest.mark.parametrize("jolts", [0, 40])
def test_whole_recordings_are_passed(bits: int, jolts: int):
    for seed in range(3):
        assert restamped(moved(seed, step=2 * np.pi / 2**bits, jolts=jolts))[1] == []


def back_and_forth(seed: int, interval: float, turn: float, step: float) -> Samples:
    """Two joints at even speeds, which turn within so many seconds (s), behind an encoder of such steps (rad)."""
    random = np.random.default_rng(seed)
    time = interval * np.arange(round(20.0 / interval))
    position = np.empty((2, len(time)))
    over = max(round(turn / interval), 1)
    for joint in position:
        way = np.arcsin(np.sin(2 * np.pi * random.uniform(0.05, 0.3) * time)) * random.uniform(0.1, 0.6)
        joint[:] = np.convolve(np.pad(way, over, mode="edge"), np.ones(over) / over, "same")[over:-over]
    position = step * np.floor(position / step)
    return Samples("a.csv", ROBOT, time, position, None, np.arange(1, len(time) + 1))


@pytest.mark.parametrize("interval", [1e-3, 2e-3, 4e-3, 8e-3])
@pytest.mark.parametrize("bits", [10, 12, 14, 16, 20])
def test_even_speeds_and_sharp_turns_are_no_loss(interval: float, bits: int):
    """The rare long step of a coarse encoder at an even speed, and the turns of a log at 125 Hz, were refused."""
    for seed in range(200, 212):
        for turn in (0.0, 0.01, 0.03):
            assert restamped(back_and_forth(seed, interval, turn, 2 * np.pi / 2**bits))[1] == [], (seed, turn)


def test_joints_that_stand_still_say_nothing():
    whole = moved()
    position = np.array([np.full(whole.count, 0.7), 1e29 * whole.position[1]])
    assert restamped(Samples("a.csv", ROBOT, whole.time, position, None, whole.row))[1] == []


def test_a_loss_that_the_clock_shows_is_none():
    whole = moved()
    kept = np.random.default_rng(1).random(whole.count) >= 0.05
    assert restamped(whole.kept(kept))[1] == []


def test_a_source_that_is_late_now_and_then_has_lost_nothing():
    whole = moved(step=0.0)
    late = np.random.default_rng(2).random(whole.count) < 0.05
    position = whole.position.copy()
    position[:, 1:][:, late[1:]] = whole.position[:, :-1][:, late[1:]]
    assert restamped(Samples("a.csv", ROBOT, whole.time, position, None, whole.row))[1] == []


@pytest.mark.parametrize("at_once", [2, 3, 4, 25])
@pytest.mark.parametrize("step", [0.0, 1e-5])
def test_several_samples_lost_at_once_are_refused_with_their_number(at_once: int, step: float):
    """A logger that drew a plot every 0.1 s stood still for 45 ms; the jumps' shadows looked like samples that were late."""
    with pytest.raises(RecordingError, match=f"by the way of about {at_once} samples") as caught:
        restamped(stalled(moved(step=step), at_once))
    missing = re.search(r"in all about ([0-9.]+) are missing for every 100", str(caught.value))
    assert missing is not None
    assert float(missing[1]) == pytest.approx(100 * at_once / (50 - at_once), rel=0.1)


def test_stalls_are_seen_beside_a_source_that_is_late():
    """Of the same log 3 % of the rows held the row before, and the next ones jumped ahead by two samples."""
    whole = stalled(moved(step=0.0), 25)
    late = np.random.default_rng(2).random(whole.count) < 0.05
    position = whole.position.copy()
    position[:, 1:][:, late[1:]] = whole.position[:, :-1][:, late[1:]]
    with pytest.raises(RecordingError, match="samples are lost"):
        restamped(Samples("a.csv", ROBOT, whole.time, position, None, whole.row))


def test_joints_that_are_slow_against_their_noise_show_long_stalls():
    whole = moved(step=2e-3)
    assert restamped(whole)[1] == []
    with pytest.raises(RecordingError, match="samples are lost"):
        restamped(stalled(whole, 25))


def test_spurts_of_joints_that_stick_and_slip_are_no_loss():
    """Where the least way of the steps around was that of a step, half of such motions were refused."""
    time = INTERVAL * np.arange(6000)
    for seed in range(40):
        random = np.random.default_rng(seed)
        steps = np.where(
            random.random((2, 6000)) < 0.02, random.exponential(1e-2, (2, 6000)), random.exponential(1e-4, (2, 6000))
        )
        position = np.array([np.convolve(np.cumsum(row), np.ones(15) / 15, "same") for row in steps])
        samples = Samples("a.csv", ROBOT, time, position, None, np.arange(1, 6001))
        assert restamped(samples)[1] == []


def test_rare_stalls_that_lose_many_samples_are_refused():
    """Less than 1 % of the steps, each of which loses 25 samples."""
    whole = moved(step=1e-5)
    kept = np.arange(whole.count) % 250 >= 25
    rows = np.arange(1, np.count_nonzero(kept) + 1)
    with pytest.raises(RecordingError, match=r"in 0\.[0-9]+ % of the steps .* about 1[01]"):
        restamped(Samples("a.csv", ROBOT, INTERVAL * rows, whole.position[:, kept], None, rows))


def stalled(whole: Samples, at_once: int) -> Samples:
    """The same, as a logger writes it that waits for so many of every 50 samples and counts on."""
    kept = np.arange(whole.count) % 50 >= at_once
    rows = np.arange(1, np.count_nonzero(kept) + 1)
    return Samples("a.csv", ROBOT, INTERVAL * rows, whole.position[:, kept], None, rows)
