"""Rates of peaks against laws whose tail is known."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.estimation.tail import Tail, clusters, fit_tail, tail_of

RATE = 20.0


def test_a_tail_gives_back_its_rate_at_its_level():
    for shape in (-0.4, 0.2):
        tail = Tail(1.0, np.array([0.5]), np.array([shape]), np.ones(1), 100, 2.0)
        assert tail.rate(1.0) == pytest.approx(50.0)
        assert tail.rate(tail.level(3.0)) == pytest.approx(3.0)
        # Davison and Smith's law itself.
        assert tail.rate(1.5) == pytest.approx(50.0 * (1.0 + shape) ** (-1.0 / shape))


@pytest.mark.slow
@pytest.mark.parametrize("shape", [-0.5, -0.2, 0.0, 0.2])
def test_the_rate_is_right_wherever_the_tail_ends(shape: float):
    # A second apart, so that each is a cluster: what exceeds a level is known exactly. A tenth of them is fitted to.
    rng, count, rates = np.random.default_rng(3), 4000, (10.0, 60.0)
    ratios, widths, shapes = [], [], []
    for _ in range(12):
        score = rng.exponential(size=count)
        score = np.expm1(shape * score) / shape if shape else score
        tail = fit_tail([np.arange(float(count))], [score], float(count), 60.0)
        for rate in rates:
            level = tail.level(rate)
            over = np.log(max(1e-12, 1.0 + shape * level)) / shape if shape else level
            ratios.append(3600.0 * np.exp(-over) / rate)
        # Above a level the law is one of the same shape again, and so wide.
        widths.append(tail.weight @ tail.width / (1.0 + shape * tail.start))
        shapes.append(tail.mean_shape)
    # The mean of 12 thresholds scatters by 6 %; where it ends, one taken for exponential is at 0.2 and 0.02 of 10 an hour.
    np.testing.assert_allclose(np.mean(np.reshape(ratios, (-1, 2)), axis=0), 1.0, atol=0.2)
    assert np.mean(widths) == pytest.approx(1.0, abs=0.07)
    assert np.mean(shapes) == pytest.approx(shape, abs=0.07)


def test_beyond_the_end_of_the_likeliest_law_the_rate_is_not_none():
    score = np.random.default_rng(0).uniform(size=2000)
    tail = fit_tail([np.arange(2000.0)], [score], 2000.0, 10.0)
    assert tail.mean_shape < -0.5
    assert tail.rate(1.0) > 0.0
    # However seldom: a level is told, and it is little above all that can be.
    assert 1.0 < tail.level(1e-6) < 1.2
    assert np.isfinite(tail.log_variance(1.0))


def test_high_rates_take_more_clusters():
    score = np.random.default_rng(0).exponential(size=8000)
    low, high = (fit_tail([np.arange(8000) / RATE], [score], 400.0, rate) for rate in (10.0, 600.0))
    assert low.clusters < 100 and high.clusters >= 2 * 600.0 / 9.0
    assert high.level(600.0) > high.start


def test_clusters_are_parted_by_half_a_second():
    time = np.arange(10) * 0.3
    score = np.array([0, 2, 0, 2, 0, 0, 2, 0, 0, 0.0])
    assert clusters(time, score, 1.0) == [(1, 1), (3, 3), (6, 6)]
    assert clusters(time / 2.0, score, 1.0) == [(1, 6)]
    assert clusters(time, score, 3.0) == []


def test_what_may_be_no_part_of_the_law_says_only_that_it_is_large():
    rng = np.random.default_rng(4)
    levels = []
    for _ in range(8):
        score = rng.exponential(size=1000)
        other = np.where(score >= np.sort(score)[-20], 100.0 * score, score)
        tails = [tail_of(item, np.log(10.0), 1000.0, censored=20, prior=0.1) for item in (score, other)]
        # However large they are.
        assert tails[0].level(1.0) == tails[1].level(1.0)
        assert tails[0].clusters == np.sum(score > np.log(10.0))
        assert tail_of(other, np.log(10.0), 1000.0, prior=0.1).level(1.0) > 3.0 * tails[0].level(1.0)
        levels.append(tails[0].level(1.0))
    # A second each: once an hour is log(3600). What is not known of the law makes it more.
    assert np.log(3600.0) < np.median(levels) < 1.2 * np.log(3600.0)
    assert tail_of(np.ones(9), 1.0, 9.0, censored=2).level(1.0) == 1.0
