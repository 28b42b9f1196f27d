"""A residual in bins: means of bounded samples, what is at rest left out, what an event left out counted again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from scara_ident.identification.binned_residual import binned, bounded_noise
from scara_ident.motion.prepared import prepare
from scara_ident.robot.robot import load_robot
from tests.arms import swing

ROBOT = load_robot()
(PART,) = prepare([swing(ROBOT, "r", seed=0, seconds=20.0, rate=250.0)], (8.0, 8.0)).stretches


def test_a_bin_is_the_mean_of_its_bounded_samples():
    left = np.zeros((2, PART.samples))
    left[0, 1000:1010] = 3.0
    left[0, 1010] = 1e6
    item = binned(0, PART, left, np.ones(2))
    assert item.size == 10
    assert item.known[0, 100] == 1.0
    assert item.left[0, 100] == pytest.approx(3.0)
    assert item.left[0, 101] == pytest.approx(5.0 / 10)
    less = item.without(np.full_like(item.taken, 1.0))
    assert less.left[0, 100] == pytest.approx(2.0)


def test_means_of_windows_are_those_of_their_bins():
    left = np.random.default_rng(0).standard_normal((2, PART.samples))
    item = binned(0, PART, left, np.ones(2))
    means = item.means(7)
    weight = item.known[1, 200:207]
    assert means[1, 200] == pytest.approx(float(weight @ item.left[1, 200:207] / weight.sum()))
    assert np.all(np.isnan(means[:, 0])), "the ends of a stretch are not used"


def test_what_an_event_left_out_counts_again():
    left = np.ones((2, PART.samples))
    out = np.zeros(PART.samples, dtype=bool)
    out[1000:1500] = True
    whole, again = (binned(0, part, left, np.ones(2)) for part in (PART, replace(PART, left_out=out)))
    assert np.array_equal(whole.known, again.known)


def test_noise_is_the_larger_of_a_recordings_own_and_of_all():
    rng = np.random.default_rng(1)
    left = [sigma * rng.standard_normal((2, PART.samples)) for sigma in (1.0, 1.0, 4.0)]
    noise = bounded_noise([PART] * 3, left, [0, 1, 2])
    assert noise[2] == pytest.approx([4.0, 4.0], rel=0.1)
    assert np.all((noise[0] > 1.0) & (noise[0] < 2.0))
    assert noise[0] == pytest.approx(noise[1], rel=0.1)


def test_at_rest_the_torque_less_the_predicted_is_known_up_to_a_constant():
    run = swing(ROBOT, "r", seed=0, seconds=20.0, rate=250.0)
    hold = slice(1500, 2000)
    position, effort = run.position.copy(), run.effort.copy()
    position[:, hold], effort[:, hold] = position[:, 1500:1501], 0.3
    effort[0, 1750:2000] += 0.5
    (part,) = prepare([replace(run, position=position, effort=effort)], (8.0, 8.0)).stretches
    still = binned(0, part, part.torque.copy(), np.ones(2)).still
    rest = np.isfinite(still[0])
    assert np.all(rest[160:190])
    assert not np.any(rest[:140]) and not np.any(rest[205:360])
    assert still[0, 180] - still[0, 165] == pytest.approx(0.5)
    assert still[1, 180] == pytest.approx(still[1, 165])
    assert binned(0, part, part.torque.copy(), np.full(2, 0.05)).anyhow[0, 180] == pytest.approx(0.25)
