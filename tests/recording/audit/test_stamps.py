"""Stamps that are late while the samples are even are seen by the positions; a clock that is uneven is believed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scara_ident.recording.audit import Samples
from scara_ident.recording.audit.stamps import coinciding, late_stamps
from scara_ident.robot.robot import load_robot

ROBOT = load_robot()
INTERVAL = 4e-3
COUNT = 4000


def path(time: np.ndarray, step: float = 1e-5) -> np.ndarray:
    """Two joints on sines, read by encoders."""
    position = np.array([np.sin(2.1 * time + 0.3), 0.8 * np.sin(3.3 * time) + 0.2 * np.cos(5.1 * time)])
    return step * np.rint(position / step)


def log(stamps: np.ndarray, taken: np.ndarray, step: float = 1e-5) -> Samples:
    """Samples taken at some times and stamped with others."""
    rows = np.arange(1, len(stamps) + 1)
    return Samples("a.csv", ROBOT, stamps, path(taken, step), None, rows)


def even(count: int = COUNT) -> np.ndarray:
    return 2.0 + INTERVAL * np.arange(count)


def late(seed: int, share: float, by: float = 0.98) -> np.ndarray:
    """Stamps of which some are late, up to just before the next."""
    random = np.random.default_rng(seed)
    return even() + INTERVAL * by * (random.random(COUNT) < share)


def misplaced(samples: Samples, taken: np.ndarray) -> float:
    """Return by how much of an interval times err; a common lag is none."""
    off = samples.time - taken
    return float(np.max(np.abs(off - np.median(off)))) / INTERVAL


@pytest.mark.parametrize("share", [0.001, 0.01, 0.05])
def test_late_stamps_are_evened(share: float):
    """1 % of them, just before the next, were taken for samples lost, and made a believed elastic joint of nothing."""
    stamps = late(3, share)
    samples, (finding,) = late_stamps(log(stamps, even()))
    assert misplaced(samples, even()) < 0.02
    assert finding.kind == "late_stamps"
    assert finding.count == np.count_nonzero(stamps != even())
    assert "3.92 ms from an even clock" in finding.message


def test_a_late_stamp_within_a_microsecond_of_the_next_is_too():
    """One of a thousand left errors of 40 % where there had been 2."""
    stamps = even()
    stamps[::1000] += INTERVAL - 1e-6
    samples, _ = late_stamps(log(stamps, even()))
    assert misplaced(samples, even()) < 0.01


@pytest.mark.slow
@settings(max_examples=25, deadline=None)
@given(st.integers(0, 1000), st.floats(0.06, 0.25))
def test_jitter_is_whose_the_positions_say(seed: int, size: float):
    random = np.random.default_rng(seed)
    uneven = even() + INTERVAL * np.clip(size * random.standard_normal(COUNT), -0.45, 0.45)
    samples, found = late_stamps(log(uneven, even()))
    assert len(found) == 1
    off = (samples.time - even()) / INTERVAL
    assert np.std(off) < 0.25 * size
    kept = log(uneven, uneven)
    assert late_stamps(kept) == (kept, [])


def test_what_arrives_late_in_bursts_is_evened_and_what_is_lost_stays_lost():
    """A stamp is never before the one before: what is held up arrives together."""
    random = np.random.default_rng(4)
    taken = np.delete(even(), [700, 1900, 1901, 2600, *range(3000, 3300)])
    delay = INTERVAL * np.where(random.random(len(taken)) < 0.1, random.exponential(2.0, len(taken)), 0.0)
    stamps = np.maximum.accumulate(taken + delay) + 1e-9 * np.arange(len(taken))
    samples, (finding,) = late_stamps(log(stamps, taken))
    assert finding.kind == "late_stamps"
    off = np.abs(samples.time - taken - np.median(samples.time - taken)) / INTERVAL
    # Just where a sample is lost within a burst, it may be one of its neighbours.
    assert np.max(off) < 1.1
    assert np.mean(off > 0.1) < 0.01
    assert np.mean(np.abs(stamps - taken) > 0.1 * INTERVAL) > 0.1


def test_a_clock_that_drifts_is_even():
    taken = even() * (1.0 + 1e-4 * np.sin(0.3 * even()))
    stamps = taken + INTERVAL * 0.9 * (np.random.default_rng(1).random(COUNT) < 0.01)
    samples, _ = late_stamps(log(stamps, taken))
    assert misplaced(samples, taken) < 0.05


def test_lost_samples_and_gaps_of_a_good_clock_are_left_alone():
    taken = np.delete(even(), [100, 900, 901, 1700, *range(2500, 2800)])
    samples = log(taken, taken)
    assert late_stamps(samples) == (samples, [])
    again = log(taken[:120], taken[:120])
    assert late_stamps(again) == (again, [])


@pytest.mark.parametrize("step", [1e-3, 0.01, 0.05])
def test_behind_a_coarse_encoder_a_clock_that_is_uneven_is_believed(step: float):
    uneven = late(3, 0.01)
    samples = log(uneven, uneven, step)
    assert late_stamps(samples) == (samples, [])


@pytest.mark.parametrize("jitter", [0.0, 0.06, 0.25])
@pytest.mark.parametrize("step", [1e-6, 1e-4, 1e-3, 0.01])
def test_where_many_samples_are_lost_good_stamps_are_believed(jitter: float, step: float):
    """8 % lost made an even clock 6 % slower, and the recording was refused for it."""
    random = np.random.default_rng(6)
    taken = even()[random.random(COUNT) >= 0.08]
    taken = taken + INTERVAL * np.clip(jitter * random.standard_normal(len(taken)), -0.45, 0.45)
    samples = log(taken, taken, step)
    assert late_stamps(samples) == (samples, [])


def test_late_stamps_are_evened_where_many_samples_are_lost():
    random = np.random.default_rng(7)
    taken = even()[random.random(COUNT) >= 0.08]
    stamps = taken + INTERVAL * random.uniform(0.0, 0.9, len(taken))
    samples, (finding,) = late_stamps(log(stamps, taken, 1e-6))
    assert finding.kind == "late_stamps"
    off = np.diff(samples.time) - np.diff(taken)
    assert np.std(off) < 0.05 * INTERVAL
    assert np.std(np.diff(stamps) - np.diff(taken)) > 0.3 * INTERVAL


def test_a_clock_that_is_even_in_most_of_a_recording_only_is_none():
    """On average even times fit four times better; where the clock is uneven they do not."""
    random = np.random.default_rng(8)
    taken, stamps = even(), even() + INTERVAL * 0.3 * random.random(COUNT)
    taken[2000:2400] = stamps[2000:2400]
    samples = log(stamps, taken, 1e-6)
    assert late_stamps(samples) == (samples, [])


@pytest.mark.parametrize(("seed", "step"), [(2, 5e-4), (9, 5e-4), (5, 3e-4)])
def test_a_few_stamps_that_fit_better_by_chance_are_no_uneven_clock(seed: int, step: float):
    """Of jitter that hardly stands out a stretch has one stamp or two, and behind an encoder's steps these fit by chance."""
    stamps = even() + INTERVAL * np.random.default_rng(seed).uniform(-0.051, 0.051, COUNT)
    samples, (finding,) = late_stamps(log(stamps, even(), step))
    assert finding.kind == "late_stamps"
    assert misplaced(samples, even()) < 0.02


def test_joints_that_stand_still_say_nothing():
    still = replace(log(late(3, 0.01), even()), position=np.zeros((2, COUNT)))
    assert late_stamps(still) == (still, [])


def test_rows_that_all_but_coincide_are_left_out():
    """20 % of jitter with steps of a nanosecond made an error of a million per cent."""
    stamps = even()
    stamps[[50, 70]] = stamps[[49, 69]] + 1e-9
    samples, (finding,) = coinciding(log(stamps, stamps))
    assert samples.count == COUNT - 2
    assert list(np.setdiff1d(np.arange(1, COUNT + 1), samples.row)) == [51, 71]
    assert (
        finding.message
        == "2 rows follow the one before within 10% of the sampling interval, first row 51 (2.196 s): left out"
    )
    assert coinciding(samples) == (samples, [])
