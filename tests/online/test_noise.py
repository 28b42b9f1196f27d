"""Sizes of noise against what was drawn."""

from __future__ import annotations

import numpy as np
import pytest

from scara_ident.online.filtered import row_filter
from scara_ident.online.noise import GIVEN_ROWS, MAX_NOISE_SHARE, PositionNoise, TorqueNoise, inertia_at, too_wide
from tests.online.made import RATE, model, signals, truth


def test_the_given_noise_counts_as_so_many_samples():
    noise = TorqueNoise.given(2, 100.0)
    np.testing.assert_array_equal(noise.scale, [1.0, 1.0])
    after = noise.after(np.array([300.0, 0.0]), np.array([100, 0]), 2.0)
    # 100 of variance 1, and 300 of 50 independent ones; what is old fades by 1e-4.
    np.testing.assert_allclose(after.scale, [400.0 / 150.0, 1.0], rtol=1e-3)
    assert after.squares[0] < 400.0
    # By what was seen alone.
    assert after.seen(100.0)[0] == pytest.approx(300.0 / 50.0, rel=1e-3)


def test_noise_of_positions_is_what_was_added_and_a_silent_encoder_does_not_lower_it():
    way, sigma = row_filter(RATE, 10.0, 1), np.array([1e-4, 4e-4])
    q = signals(20.0)[0]
    random, noise, slow = np.random.default_rng(0), PositionNoise.none(2), np.full(2, 0.01)
    noisy = q + sigma[:, None] * random.standard_normal(q.shape)
    for k in range(0, q.shape[1] - way.window, way.new):
        window = np.array([noisy, 0.0 * noisy])[..., k : k + way.window]
        noise = noise.after(window, way.motion(window), slow, way)
    size = np.sqrt(noise.squares / noise.counted)
    # What the low-pass leaves of it is missing: 2 c^2 sum of squares of its weights, about an eighth.
    np.testing.assert_allclose(size, sigma, rtol=0.1)
    still = np.full((2, 2, way.window), 0.3)
    same = noise.after(still, way.motion(still), slow, way)
    np.testing.assert_array_equal(same.squares, noise.squares)
    np.testing.assert_array_equal(same.counted, noise.counted)
    # At the speed of rest noise alone is five standard deviations away from zero.
    white = sigma[:, None] * random.standard_normal((2, 200 * way.window))
    speeds = [way.motion(np.array([part, part])).v for part in np.split(white, 200, axis=1)]
    assert np.all(noise.rest(way) >= 4.5 * np.std(np.concatenate(speeds, axis=1), axis=1))
    assert np.all(noise.rest(way) >= 0.9 * np.sqrt(12.0) * sigma * way.cut)


def test_before_any_sample_nothing_is_known():
    np.testing.assert_array_equal(PositionNoise.none(3).rest(row_filter(RATE, 10.0, 1)), np.zeros(3))


def test_noise_of_positions_is_white_noise_less_what_the_low_pass_leaves():
    way, sigma = row_filter(RATE, 10.0, 1), np.array([1e-4, 4e-4])
    random, noise = np.random.default_rng(3), PositionNoise.none(2)
    for _ in range(300):
        # Of joints that only tremble, which here count as moving.
        window = np.array([sigma[:, None] * random.standard_normal((2, way.window)), np.zeros((2, way.window))])
        noise = noise.after(window, way.motion(window), np.zeros(2), way)
    np.testing.assert_allclose(noise.variance(way), sigma**2, rtol=0.05)


def test_what_it_makes_of_rows_is_what_drawn_noise_makes():
    """Accelerations of white noise under the pulse, against the same of white torques."""
    for band in (5.0, 10.0, 40.0):
        way = row_filter(RATE, band, 1)
        drawn = np.random.default_rng(4).standard_normal((2, 1, 400 * way.new + way.window))
        rows: list[list[float]] = [[], []]
        for k in range(0, 400 * way.new, way.new):
            motion = way.motion(drawn[..., k : k + way.window]).part(way.widen, None)
            for own, signal in zip(rows, (motion.a[0], motion.torque[0]), strict=True):
                own += list(way.pulses @ signal[: way.pulses.shape[1]])
        acceleration, torque = (np.mean(np.square(own)) for own in rows)
        assert acceleration / torque == pytest.approx(way.acceleration_gain, rel=0.1)


def test_inertia_is_what_unit_accelerations_ask_for():
    q = np.array([0.3, -1.1])
    robot, value = model().robot, truth()
    found = inertia_at(model(), value, q)
    # A planar arm: I1 + 2 a cos q2 and so on are symmetric, and depend on the second joint alone.
    np.testing.assert_allclose(found, found.T, atol=1e-12)
    assert np.all(np.linalg.eigvalsh(found) > 0.0)
    np.testing.assert_allclose(found, inertia_at(model(), value, q + np.array([1.0, 0.0])))
    assert len(found) == robot.n


def test_what_it_makes_is_a_mean_over_rows_of_which_few_say_nothing():
    way = row_filter(RATE, 10.0, 1)
    inertia, weight = np.array([[2.0, 1.0], [1.0, 3.0]]), np.array([10.0, 20.0])
    known = PositionNoise(np.array([1e-6, 4e-6]), np.full(2, 1e4), np.zeros(2), np.zeros(2))
    first, second = known.variance(way)
    expected = weight**2 * way.acceleration_gain * np.array([4.0 * first + second, first + 9.0 * second])
    few = known.after_rows(inertia, weight, np.array([GIVEN_ROWS, GIVEN_ROWS - 1]), way)
    np.testing.assert_allclose(few.in_rows, [expected[0], 0.0])
    more = few.after_rows(inertia, weight, np.array([0, 1]), way)
    np.testing.assert_allclose(more.in_rows, expected)


def test_a_band_that_does_has_no_more_of_it_at_its_end_than_of_the_torques():
    joints, whole, rows = ("a", "b"), np.array([2.0, 4.0]), np.array([200.0, 1e6])
    assert too_wide(MAX_NOISE_SHARE * whole, whole, rows, 10.0, joints) is None
    # Of 200 rows the variance is known to a tenth.
    more = np.array([1.15, 1.0]) * MAX_NOISE_SHARE * whole
    assert too_wide(more, whole, rows, 10.0, joints) is None
    assert too_wide(more, whole, 100.0 * rows, 10.0, joints) is not None
    said = too_wide(np.array([0.1, 3.0]), whole, rows, 10.0, joints)
    # It grows as the fourth power of the band: three times the torque's falls to a fifth.
    assert said is not None and f"use a band of {10.0 * (0.2 / 3.0) ** 0.25:.2g} Hz" in said
    assert "makes 75% on b of the residual" in said
    # Where all is noise of positions the torque's is as it was given, and no larger than may still be there.
    for whole_of, torque in ((100.0, 1.0), (4.0, 0.2)):
        said = too_wide(np.array([1.2 * whole_of, 0.0]), np.array([whole_of, 1.0]), rows, 10.0, joints)
        assert said is not None and "makes 100% on a of the residual" in said
        assert f"use a band of {10.0 * (0.2 * torque / (1.2 * whole_of)) ** 0.25:.2g} Hz" in said
