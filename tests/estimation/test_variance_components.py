"""Variance components against the closed form of one direction, and on several joints as on each alone."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from scara_ident.estimation.variance_components import components, differing, expected


def runs_of(seed: int, variance: np.ndarray, count: int = 12) -> tuple[np.ndarray, np.ndarray]:
    """Return products and aims of runs that lie off by so much along each direction, told with unit noise of a row."""
    rng = np.random.default_rng(seed)
    rows = rng.standard_normal((count, len(variance), 50))
    off = np.sqrt(variance) * rng.standard_normal((count, len(variance)))
    products = rows @ rows.transpose(0, 2, 1)
    return products, np.einsum("rkl,rl->rk", products, off) + np.einsum(
        "rkn,rn->rk", rows, rng.standard_normal((count, 50))
    )


@pytest.mark.parametrize("draws", [4.0, 3.0, 1.5])
def test_one_direction_of_equal_precision_has_the_variance_of_the_closed_form(draws: float):
    aims = np.array([3.0, -2.0, 4.0, -5.0])
    precision = 10.0
    variance = components(
        np.full((1, 4, 1, 1), precision),
        precision * aims[None, :, None],
        np.ones((1, 1), dtype=bool),
        np.full((1, 1), draws),
    )
    assert_allclose(variance, [[np.sum(aims**2) / draws - 1.0 / precision]], rtol=1e-6)
    mean, spread = expected(np.full((1, 4, 1, 1), precision), precision * aims[None, :, None], variance)
    assert_allclose(mean[0, :, 0], aims * variance[0] / (variance[0] + 1.0 / precision))
    assert_allclose(spread, 1.0 / (1.0 / variance[0, 0] + precision))


def test_several_joints_are_as_each_alone_and_what_is_not_there_is_left_out():
    truth = np.array([[4.0, 0.0, 1.0], [0.0, 0.0, 0.0], [0.0, 9.0, 0.0], [1.0, 2.0, 3.0]])
    made = [runs_of(seed, variance) for seed, variance in enumerate(truth)]
    products, aims = (np.array(part) for part in zip(*made, strict=True))
    kept = np.ones(truth.shape, dtype=bool)
    kept[3, 1] = False
    draws = np.full(truth.shape, 12.0)
    differ = differing(products, aims, kept, draws)
    found = components(products, aims, differ, draws)
    for joint in range(len(truth)):
        own = slice(joint, joint + 1)
        assert_array_equal(differ[joint], differing(products[own], aims[own], kept[own], draws[own])[0])
        alone = components(products[own], aims[own], differ[own], draws[own])
        assert_allclose(found[joint], alone[0], rtol=1e-12)
    assert_array_equal(differ[:3], truth[:3] > 0.0)
    assert not differ[3, 1]
    assert_array_equal(found > 0.0, differ)
    assert not np.any(components(products, aims, np.zeros(kept.shape, dtype=bool), draws))
