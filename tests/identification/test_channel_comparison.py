"""What readings leave on time held out, against fits made one by one, and when one leaves far less."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scara_ident.estimation.least_squares import weighted_value
from scara_ident.identification.channel_comparison import PIECES, better, far_less, few, held_out, mean, relative
from tests.identification.turned_arm import arm, runs, seen


def test_a_better_reading_has_to_be_better_block_by_block() -> None:
    rng = np.random.default_rng(0)
    left = np.exp(0.3 * rng.standard_normal((20, 2)))
    assert better(left, 0.5 * left)
    assert not better(left, left)
    # One block that is far better, and none of the others: the mean falls, and nothing is shown.
    once = left * np.where(np.arange(20) == 3, 1e-9, 1.0)[:, None]
    assert not better(left, once)
    assert not better(left[:1], 0.1 * left[:1])


def test_pieces_are_predicted_from_the_others() -> None:
    held = seen(arm(), runs(arm(), (0,) * 4))
    left, whole = held_out(held)
    place = np.concatenate([np.arange(count) * PIECES // count for count in np.bincount(held.owner)])
    chosen = np.flatnonzero(place != 1)
    others = replace(held, joints=tuple(rows.part(chosen) for rows in held.joints), owner=held.owner[chosen])
    value = weighted_value(others.by_joint)
    for block in np.flatnonzero(place == 1):
        for j, rows in enumerate(held.joints):
            residual = rows.part(np.array([block])).left(value)
            expected = np.sqrt(residual @ residual / rows.counts[block]) / held.by_joint[j].torque_rms
            assert np.isclose(left[block, j], expected, rtol=1e-6)
    # In the band white noise of 0.05 N m is a few per cent of what the last joints take at the most.
    assert np.all(whole >= relative(weighted_value(held.by_joint), held))
    assert np.all(whole < 0.1)
    assert not few(held)


def test_far_less_is_half_on_the_joints_that_are_badly_explained() -> None:
    rng = np.random.default_rng(1)
    blocks = np.exp(0.1 * rng.standard_normal((20, 3))) * np.array([0.5, 0.01, 0.01])
    left = blocks, np.array([0.5, 0.01, 0.01])
    mended = blocks * np.array([0.2, 1.0, 1.0]), np.array([0.1, 0.01, 0.01])
    assert np.allclose(far_less(left, mended, np.inf, poor=True) or (), (0.5, 0.1))
    assert far_less(left, mended, 0.05, poor=True) is None
    assert far_less(left, mended, np.inf, poor=False) is None
    assert far_less(left, left, np.inf, poor=True) is None
    assert np.isclose(mean(np.array([0.04, np.nan, 0.01])), 0.02)


def test_far_less_of_what_is_hardly_explained_counts_where_all_joints_hide_it() -> None:
    rng = np.random.default_rng(2)
    shares = np.array([0.1, 0.2, 0.1, 0.3, 1.1, 0.4])
    blocks = np.exp(0.1 * rng.standard_normal((20, 6))) * shares

    def read(*ratios: float) -> tuple[np.ndarray, np.ndarray]:
        return blocks * np.array(ratios), shares * np.array(ratios)

    left = read(1, 1, 1, 1, 1, 1)
    for poor in (True, False):
        assert np.allclose(far_less(left, read(0.8, 1, 0.8, 0.9, 0.2, 0.9), np.inf, poor=poor) or (), (1.1, 0.22))
        assert far_less(left, read(0.8, 1, 0.8, 0.9, 0.6, 0.9), np.inf, poor=poor) is None
        # What it costs the other joints counts too, and so does what it may leave at most.
        assert far_less(left, read(1.6, 1.6, 1.6, 1.6, 0.2, 1.6), np.inf, poor=poor) is None
        assert far_less(left, read(0.8, 1, 0.8, 0.9, 0.2, 0.9), 0.2, poor=poor) is None
    # Of a joint of which half the power is explained an effect may be the reason.
    left = left[0], shares * np.array([1, 1, 1, 1, 0.6, 1])
    assert far_less(left, read(0.8, 1, 0.8, 0.9, 0.1, 0.9), np.inf, poor=True) is None
