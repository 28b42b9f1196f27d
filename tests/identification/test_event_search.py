"""What stands out in time: a step of some tenths of a second, and neither heavy tails nor what the motion repeats."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.identification.event_search import Binned, Segment, binned, bounded_noise, standing_out
from scara_ident.motion.prepared import PreparedStretch, prepare
from scara_ident.robot.robot import load_robot
from tests.arms import swing

ROBOT = load_robot()
RATE = 250.0
STRETCHES = prepare(
    [swing(ROBOT, f"r{k}", seed=k, seconds=20.0, rate=RATE) for k in range(4)], (8.0, 8.0)
).stretches


def searched(left: list[np.ndarray], parts: tuple[PreparedStretch, ...] = STRETCHES) -> list[Segment]:
    noise = bounded_noise(parts, left, range(len(parts)))
    return standing_out([binned(k, part, row, noise[k]) for k, (part, row) in enumerate(zip(parts, left, strict=True))])


def white(seed: int = 0) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    return [rng.standard_normal((2, part.samples)) for part in STRETCHES]


@pytest.mark.parametrize("seconds", [0.3, 1.0, 2.0])
def test_a_push_of_three_times_the_noise_is_found_within_a_tenth_of_a_second(seconds: float):
    left = white()
    first = int(7.0 * RATE)
    left[2][0, first : first + int(seconds * RATE)] += 3.0
    (found,) = searched(left)
    assert found.binned.recording == 2
    assert found.start * found.binned.width == pytest.approx(7.0, abs=0.1)
    assert found.stop * found.binned.width == pytest.approx(7.0 + seconds, abs=0.1)
    assert found.score[0] > 1.0 > found.score[1]


def test_heavy_tails_and_noise_that_remembers_are_no_event():
    rng = np.random.default_rng(1)
    heavy = [rng.standard_t(3, (2, part.samples)) for part in STRETCHES]
    assert searched(heavy) == []
    coloured = white(2)
    for row in coloured:
        for k in range(1, row.shape[1]):
            row[:, k] += np.exp(-1.0 / (0.1 * RATE)) * row[:, k - 1]
    assert searched(coloured) == []


def test_what_depends_on_the_motion_is_no_event():
    left = [row + 4.0 * (np.abs(part.motion.v) < 0.15) for row, part in zip(white(3), STRETCHES, strict=True)]
    assert searched(left) == []


def test_a_change_that_lasts_is_no_event():
    left = white(4)
    left[1][0, int(8.0 * RATE) :] += 3.0
    assert searched(left) == []


def test_a_bin_is_the_mean_of_its_bounded_samples():
    part = STRETCHES[0]
    left = np.zeros((2, part.samples))
    left[0, 1000:1010] = 3.0
    left[0, 1010] = 1e6
    item: Binned = binned(0, part, left, np.ones(2))
    place = 1000 // item.size
    used = item.used[0, place * item.size : (place + 1) * item.size]
    assert used.all()
    assert item.left[0, 100] == pytest.approx(3.0)
    assert item.left[0, 101] == pytest.approx(5.0 / item.size)
