"""The threshold against simulated false alarms, and white scores."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.online.detector import Averages, mean_run, threshold, white_scores


@pytest.mark.parametrize(("causes", "share", "blocks"), [(1, 1.0, 200.0), (3, 0.2, 200.0), (6, 0.1, 200.0)])
def test_false_alarms_are_as_far_apart_as_was_asked_for(causes, share, blocks):
    limit = threshold(causes, share, blocks)
    random, count = np.random.default_rng(0), 2000
    vectors, total, alarms = np.zeros((count, causes)), 0.0, 0
    while alarms < 4000:
        vectors = (1.0 - share) * vectors + share * random.standard_normal((count, causes))
        over = np.sum(vectors**2, axis=1) * (2.0 - share) / share > limit
        alarms, total = alarms + int(np.count_nonzero(over)), total + count
        vectors[over] = 0.0
    np.testing.assert_allclose(total / alarms, blocks, rtol=0.08)
    np.testing.assert_allclose(mean_run(causes, share, limit), blocks, rtol=1e-2)


def test_without_memory_the_threshold_is_chi_squared():
    from scipy.special import chdtri

    np.testing.assert_allclose(threshold(4, 1.0, 1000.0), chdtri(4, 1e-3), rtol=2e-3)


def test_white_scores_are_white_and_keep_out_what_is_not_determined():
    random = np.random.default_rng(1)
    root = random.standard_normal((3, 3)) * np.array([[1.0], [30.0], [0.01]])
    drawn = root @ random.standard_normal((3, 20000))
    white = np.array([white_scores(x, root @ root.T) for x in drawn.T[:4000]])
    np.testing.assert_allclose(np.cov(white.T), np.eye(3), atol=0.1)
    silent = np.diag([1.0, 0.0, 1.0])
    assert white_scores(np.array([1.0, 0.0, 2.0]), silent)[1] == 0.0


def test_the_likeliest_cause_is_the_one_that_explains_most():
    information = np.array([[4.0, 1.8], [1.8, 1.0]])
    # Cause 1 acts with size 3: its scores are the information's second column times 3.
    averages = Averages.none(2)
    for _ in range(20):
        averages = averages.after(3.0 * information[:, 1], information, 0.3)
    place, sizes = averages.likeliest()
    assert place == 1
    np.testing.assert_allclose(sizes[1], 3.0, rtol=1e-6)
    assert averages.length(0.3) > 1.0
