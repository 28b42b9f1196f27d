"""Even clocks are told with their lost samples, by the stamps where few are lost, by the positions where many are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.recording.audit.even_clock import even_clocks
from tests.recording.audit.test_stamps import COUNT, INTERVAL, even, log, misplaced


def lossy(seed: int, share: float) -> np.ndarray:
    """Return the times of samples of which a share is lost."""
    return even()[np.random.default_rng(seed).random(COUNT) >= share]


@pytest.mark.parametrize("share", [0.03, 0.08, 0.2])
@pytest.mark.parametrize("joints", [1, 2])
def test_many_lost_samples_are_counted_by_the_way_of_the_joints(share: float, joints: int):
    """An interval over a hundred samples of which eight are lost was a false clock."""
    taken = lossy(1, share)
    stamps = taken + INTERVAL * np.random.default_rng(2).uniform(0.0, 0.9, len(taken))
    samples = log(stamps, taken, 1e-6)
    if joints == 1:
        samples = replace(samples, position=np.array([samples.position[0], np.zeros(len(taken))]))
    found = even_clocks(samples)[-1]
    steps = np.rint(np.diff(found) / INTERVAL) - np.rint(np.diff(taken) / INTERVAL)
    speed = np.abs(np.gradient(samples.position, taken, axis=1)).max(axis=0)
    fast = (speed > 0.3 * np.max(speed))[1:]
    # Of many lost in a row now and then one is taken for its neighbour.
    assert np.count_nonzero(steps[fast]) < 2e-3 * np.count_nonzero(fast)
    # The mean of a hundred stamps, each off by 0.26 of an interval (std), is what the clock goes by.
    assert np.std((np.diff(found) - np.diff(taken))[fast & (steps == 0)]) < 0.01 * INTERVAL


def test_where_few_are_lost_the_stamps_tell():
    taken = np.delete(even(), [500, 1700, 1701, 3000])
    stamps = taken + 0.9 * INTERVAL * (np.random.default_rng(3).random(len(taken)) < 0.02)
    still = replace(log(stamps, taken), position=np.zeros((2, len(taken))))
    (found,) = even_clocks(still)
    assert misplaced(replace(still, time=found), taken) < 0.02


def test_without_motion_many_lost_samples_leave_no_clock():
    taken = lossy(1, 0.08)
    stamps = taken + INTERVAL * np.random.default_rng(2).uniform(0.0, 0.3, len(taken))
    assert even_clocks(replace(log(stamps, taken), position=np.zeros((2, len(taken))))) == []


@pytest.mark.parametrize("step", [0.02, 0.05, 0.5])
def test_behind_a_coarse_encoder_neither_do_the_positions_tell(step: float):
    taken = lossy(1, 0.08)
    stamps = taken + INTERVAL * np.random.default_rng(2).uniform(0.0, 0.3, len(taken))
    assert even_clocks(log(stamps, taken, step)) == []


def test_a_source_slower_than_the_log_is_even_by_the_positions():
    """By the stamps it lost a sample of fifty; no joint went farther there."""
    taken = even() * 1.02
    stamps = INTERVAL * np.floor(taken / INTERVAL) + 1e-9 * np.arange(COUNT)
    found = even_clocks(log(stamps, taken, 1e-6))[-1]
    inner = slice(100, -100)
    np.testing.assert_allclose(np.diff(found)[inner], 1.02 * INTERVAL, rtol=0.01)


def test_a_gap_behind_the_first_sample_stays():
    taken = np.concatenate([[even()[0] - 15.0 * INTERVAL], even()])
    stamps = taken + 0.9 * INTERVAL * (np.random.default_rng(3).random(len(taken)) < 0.01)
    stamps[0] = taken[0]
    for found in even_clocks(log(stamps, taken)):
        assert np.max(np.abs(found - taken)) < 0.05 * INTERVAL
