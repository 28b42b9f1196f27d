"""Residuals gathered over a signal."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.report.bins import binned_means, tail_means


def test_binned_means_are_those_of_the_function_with_errors_of_their_size():
    random = np.random.default_rng(0)
    errors = []
    for _ in range(40):
        x = random.uniform(-1.0, 1.0, 4000)
        means = binned_means(x, 3.0 * x + random.standard_normal(4000), (-1.0, 1.0), 10)
        errors.append((means.y - 3.0 * means.x) / means.error)
    assert np.std(errors) == pytest.approx(1.0, abs=0.12)


def test_means_over_one_long_visit_have_errors_of_their_size():
    """Over time every bin is visited once; correlation over a few samples must not make the band too narrow."""
    random = np.random.default_rng(3)
    errors = []
    for _ in range(40):
        noise = np.convolve(random.standard_normal(8004), np.ones(5) / 5.0, "valid")
        means = binned_means(np.arange(8000.0), noise, (0.0, 8000.0), 10)
        errors.append(means.y / means.error)
    assert np.std(errors) == pytest.approx(1.0, abs=0.15)


def test_what_is_large_in_few_samples_only_has_its_means_too():
    random = np.random.default_rng(5)
    x = 0.1 * random.standard_normal(10000)
    x[random.choice(10000, 100, replace=False)] = 10.0 + random.standard_normal(100)
    means = tail_means(x, 2.0 * x + 0.01 * random.standard_normal(10000))
    shown = np.isfinite(means.y)
    assert np.count_nonzero(means.x[shown] > 9.0) >= 2
    np.testing.assert_allclose(means.y[shown], 2.0 * means.x[shown], atol=0.02)
