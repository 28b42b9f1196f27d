"""Delays that joints tell together: pooled by how sure each is, and believed to differ only where the joints agree."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from scara_ident.estimation.shared_delays import CHANCE, shared_delays

# Two kinds: the delay, and another that runs differ by.
JOINTS, RUNS, ROWS = 4, 6, 400


def told(late: np.ndarray, *, rng: np.random.Generator, other: float = 0.0, alone: np.ndarray | None = None):
    """What joints of different loudness tell of runs that are late by ``late``, with noise of one unit on every row."""
    products, aims = np.zeros((JOINTS, RUNS, 2, 2)), np.zeros((JOINTS, RUNS, 2))
    for joint in range(JOINTS):
        for run in range(RUNS):
            rows = rng.standard_normal((2, ROWS)) * np.array([[2.0 ** (joint - 1)], [1.0]])
            rows[1] += 0.5 * rows[0]
            own = late[run] + (alone[run] if alone is not None and joint == 0 else 0.0)
            left = own * rows[0] + other * rng.standard_normal() * rows[1] + rng.standard_normal(ROWS)
            products[joint, run], aims[joint, run] = rows @ rows.T, rows @ left
    priors = np.tile([0.0, other**2], (JOINTS, 1))
    return products, aims, priors


def pooled(products, aims, priors, units=1.0):
    return shared_delays(products, aims, priors, np.full(JOINTS, units), 0, np.full(JOINTS, 0.5))


def test_a_delay_is_that_of_all_rows_by_least_squares_beside_a_constant_of_each_joint():
    rng = np.random.default_rng(1)
    late = rng.standard_normal(RUNS)
    products, aims, priors = told(late, rng=rng, other=3.0)
    priors[:, 1] = np.inf
    found = pooled(products, aims, priors, units=1e-3)
    assert found is not None
    # Columns: of each run its delay, of each joint a constant, of both together the other kind.
    count = RUNS + JOINTS
    size = count + JOINTS * RUNS
    whole, aim = np.zeros((size, size)), np.zeros(size)
    for joint in range(JOINTS):
        for run in range(RUNS):
            (a, b), (_, c) = products[joint, run]
            x, y = aims[joint, run]
            other = count + joint * RUNS + run
            for k in (run, RUNS + joint):
                aim[k] += x
                whole[k, other] = whole[other, k] = b
                for m in (run, RUNS + joint):
                    whole[k, m] += a
            whole[other, other], aim[other] = c, y
    dense = (np.linalg.pinv(whole, hermitian=True) @ aim)[:RUNS]
    assert_allclose(found.of_run - found.of_run[0], 1e-3 * (dense - dense[0]), rtol=1e-6)
    assert_allclose(found.of_run - found.of_run[0], 1e-3 * (late - late[0]), atol=2e-4)


def test_a_constant_of_one_joint_is_no_disagreement():
    rng = np.random.default_rng(6)
    late = 0.2 * rng.standard_normal(RUNS)
    found, again = (
        pooled(*told(late, rng=np.random.default_rng(7), alone=np.full(RUNS, constant))) for constant in (0.0, 2.0)
    )
    assert found is not None
    assert again is not None
    assert again.p_value == pytest.approx(found.p_value)
    assert_allclose(np.diff(again.of_run), np.diff(found.of_run))


@pytest.mark.slow
def test_recordings_that_are_late_alike_differ_by_chance_alone():
    rng = np.random.default_rng(2)
    found = [pooled(*told(np.full(RUNS, 0.3), rng=rng, other=0.1)) for _ in range(300)]
    share = np.mean([item.differ for item in found if item is not None])
    # A share of 1 % of 300: 9 have a chance of 0.4 %.
    assert share <= 3.0 * CHANCE
    assert np.median([item.p_value for item in found if item is not None]) == pytest.approx(0.5, abs=0.15)


def test_what_differs_on_all_joints_is_found_with_its_size():
    rng = np.random.default_rng(3)
    found = [pooled(*told(0.2 * rng.standard_normal(RUNS), rng=rng)) for _ in range(40)]
    assert all(item is not None and item.differ for item in found)
    sizes = [item.std for item in found if item is not None]
    assert np.sqrt(np.mean(np.square(sizes))) == pytest.approx(0.2, rel=0.15)
    assert found[0] is not None
    assert found[0].share == pytest.approx(0.5 * found[0].std)


def test_what_one_joint_shows_and_the_others_do_not_is_none():
    rng = np.random.default_rng(4)
    differing = [
        pooled(*told(np.zeros(RUNS), rng=rng, alone=0.5 * rng.standard_normal(RUNS))).differ for _ in range(100)
    ]
    assert np.mean(differing) <= 0.05


def test_a_joint_without_torque_that_changes_takes_no_part():
    rng = np.random.default_rng(5)
    products, aims, priors = told(np.arange(RUNS) / 10.0, rng=rng)
    units = np.array([1.0, 0.0, 1.0, 1.0])
    found = shared_delays(products, aims, priors, units, 0, np.ones(JOINTS))
    aims[1] += 1e3
    again = shared_delays(products, aims, priors, units, 0, np.ones(JOINTS))
    assert found is not None
    assert again is not None
    assert_allclose(again.of_run, found.of_run)
    assert shared_delays(products, aims, priors, np.zeros(JOINTS), 0, np.ones(JOINTS)) is None


def test_pieces_of_one_recording_have_one_delay():
    rng = np.random.default_rng(8)
    late = np.array([0.0, 0.0, 0.0, 3.0, 3.0, 3.0])
    products, aims, priors = told(late, rng=rng)
    pieces = np.array([0, 0, 0, 3, 3, 3])
    found = shared_delays(products, aims, priors, np.full(JOINTS, 1.0), 0, np.full(JOINTS, 0.5), pieces)
    assert found is not None and found.differ
    assert_allclose(found.of_run, np.repeat([-1.5, 1.5], 3), atol=0.2)
    assert shared_delays(products, aims, priors, np.full(JOINTS, 1.0), 0, np.full(JOINTS, 0.5), 0 * pieces) is None
