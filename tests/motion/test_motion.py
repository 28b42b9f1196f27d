"""Stretches of recordings over jitter and gaps, and their motion."""

from __future__ import annotations

import pickle
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from scara_ident.errors import RecordingError
from scara_ident.motion.low_pass import differentiate
from scara_ident.motion.motion import Motion, Stretch, motion_of, stretches, thinned, torque_of
from scara_ident.recording.recording import Recording

RATE = 1000.0


def recorded(time: np.ndarray, position: np.ndarray, effort: np.ndarray | None = None) -> Recording:
    joints = tuple(f"j{k + 1}" for k in range(len(position)))
    return Recording("run_1", "run", 1, joints, time, position, effort)


def sine(frequency: float, time: np.ndarray, phase: float = 0.4) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    w = 2 * np.pi * frequency
    return np.sin(w * time + phase), w * np.cos(w * time + phase), -(w**2) * np.sin(w * time + phase)


def test_jittered_time_gives_the_derivatives_of_the_motion():
    rng = np.random.default_rng(0)
    time = np.arange(5000) / RATE + 0.2e-3 * rng.uniform(-1, 1, 5000)
    (part,) = stretches(recorded(time, sine(1.0, time)[0][None], sine(2.0, time)[0][None]))
    assert_allclose(np.diff(part.time), 1.0 / part.rate, rtol=1e-6)
    assert part.rate == pytest.approx(RATE, rel=1e-4)
    moved = motion_of(part, [20.0])
    inside = slice(300, -300)
    for found, exact, error in zip((moved.q, moved.v, moved.a), sine(1.0, part.time), (1e-9, 1e-8, 1e-7), strict=True):
        assert_allclose(found[0, inside], exact[inside], atol=error * np.max(np.abs(exact)))
    # Torque is interpolated linearly: w^2 h^2 / 8.
    assert_allclose(torque_of(part)[0, inside], sine(2.0, part.time)[0][inside], atol=(2 * np.pi * 2e-3) ** 2 / 4)
    # Taken for uniform time, the same samples are wrong by orders more.
    naive = differentiate(sine(1.0, time)[0][None], RATE, 20.0)[2][0]
    assert np.max(np.abs(naive[inside] - sine(1.0, np.arange(5000) / RATE)[2][inside])) > 1e-3 * (2 * np.pi) ** 2


def test_uniform_samples_are_taken_as_they_are():
    time = np.arange(500) / RATE
    position = np.random.default_rng(0).standard_normal((2, 500))
    (part,) = stretches(recorded(time, position, 2 * position))
    np.testing.assert_array_equal(part.position, position)
    np.testing.assert_array_equal(torque_of(part), 2 * position)
    assert part.rate == pytest.approx(RATE)
    assert (part.name, part.trajectory) == ("run_1", "run")


def test_a_recording_is_cut_at_its_gaps_and_nothing_bridges_them():
    time = np.arange(4000) / RATE
    keep = ((time < 1.0) | (time >= 1.5)) & ((time < 3.0) | (time >= 3.006))
    parts = stretches(recorded(time[keep], sine(1.0, time[keep])[0][None]))
    assert [(round(part.time[0], 3), round(part.time[-1], 3)) for part in parts] == [
        (0.0, 0.999),
        (1.5, 2.999),
        (3.006, 3.999),
    ]
    assert sum(len(part.time) for part in parts) == np.count_nonzero(keep)


def test_a_few_dropped_samples_are_filled_in():
    time = np.arange(2000) / RATE
    keep = np.ones(2000, dtype=bool)
    keep[[500, 501, 502, 1200]] = False
    (part,) = stretches(recorded(time[keep], sine(2.0, time[keep])[0][None]))
    assert len(part.time) == 2000
    assert_allclose(part.position[0], sine(2.0, time)[0], atol=1e-9)


def test_splinters_between_gaps_are_left_out():
    time = np.concatenate([np.arange(100), 200 + np.arange(3), 300 + np.arange(100)]) / RATE
    assert [len(part.time) for part in stretches(recorded(time, time[None]))] == [100, 100]


def test_a_recording_of_splinters_is_refused():
    time = np.array([0, 1, 2, 100, 101, 102, 200, 201]) / RATE
    with pytest.raises(RecordingError, match="run_1: no four samples in a row"):
        stretches(recorded(time, time[None]))


def test_each_joint_has_its_own_cut_off():
    time = np.arange(3000) / RATE
    position = np.array([sine(10.0, time)[0]] * 2)
    (part,) = stretches(recorded(time, position))
    moved = motion_of(part, [10.0, 40.0])
    assert moved.cuts == (10.0, 40.0)
    middle = slice(1000, 2000)
    assert_allclose(moved.q[0, middle], 0.5 * position[0, middle], atol=1e-6)
    assert_allclose(moved.q[1, middle], position[1, middle], atol=2e-5)
    with pytest.raises(ValueError):
        motion_of(part, [10.0])


def test_a_part_of_a_motion_has_all_its_signals():
    time = np.arange(100) / RATE
    (part,) = stretches(recorded(time, sine(2.0, time)[0][None], time[None]))
    piece = motion_of(part, [50.0]).part(10, 30)
    assert piece.samples == 20
    assert_allclose(piece.time, time[10:30])
    assert piece.q.shape == piece.v.shape == piece.a.shape == (1, 20)
    assert piece.torque is not None
    assert_allclose(piece.torque[0], time[10:30])
    assert piece.cuts == (50.0,)


def test_torque_is_needed_where_it_is_asked_for():
    time = np.arange(100) / RATE
    (part,) = stretches(recorded(time, time[None]))
    with pytest.raises(RecordingError, match="run_1: no effort was recorded"):
        torque_of(part)


def whole(position: np.ndarray, torque: np.ndarray | None) -> Stretch:
    time = 3.0 + np.arange(position.shape[1]) / RATE
    return Stretch("a_1", "a", time, position, torque, RATE, slice(0, position.shape[1]))


def test_slow_signals_stay_where_they_were_in_time():
    time = 3.0 + np.arange(10_003) / RATE
    slow = np.sin(2.0 * np.pi * 0.5 * time)[None]
    part = thinned(whole(slow, 2.0 * slow), 10)
    assert part.rate == 100.0
    assert part.position.shape == (1, 1000)
    # A mean over 10 ms takes off (pi f T)^2 / 6 of the amplitude.
    np.testing.assert_allclose(part.position[0], np.sin(np.pi * part.time), atol=(np.pi * 0.5 * 0.01) ** 2 / 6 * 1.1)
    assert part.torque is not None
    np.testing.assert_allclose(part.torque, 2.0 * part.position)


def test_white_noise_keeps_its_density():
    noise = np.random.default_rng(0).standard_normal((1, 200_000))
    part = thinned(whole(noise, None), 8)
    assert part.torque is None
    np.testing.assert_allclose(np.var(part.position) / part.rate, np.var(noise) / RATE, rtol=0.03)


def test_motion_is_made_once_and_short_stretches_stay():
    signal = np.random.default_rng(0).standard_normal((1, 40))
    part = whole(signal, signal)
    assert thinned(part, 5).position is thinned(part, 5).position
    assert thinned(part, 1) is part
    assert thinned(part, 11) is part


def test_motions_that_differ_by_their_torque_alone_share_what_follows_from_their_state():
    time = np.arange(10) / 100.0
    q = np.array([np.sin(time)])
    motion = Motion("m", "m", time, q, q, q, q, 100.0)
    other = motion.with_torque(2.0 * q)
    assert other.with_torque(None).kinematics is motion and motion.kinematics is motion
    assert other.torque is not None and other.torque[0, 3] == 2.0 * q[0, 3]
    # Positions that are others decide something else.
    moved = replace(other, q=q + 1.0)
    assert moved.kinematics is moved
    sent = pickle.loads(pickle.dumps(other)).kinematics
    assert sent.torque is not None and sent.torque[0, 3] == q[0, 3]


def test_what_is_low_passed_is_held_once_and_forgotten_where_nothing_asks_for_it():
    time = np.arange(400) / RATE
    part = whole(np.array([sine(1.0, time)[0], sine(2.0, time)[0]]), None)
    first, second = motion_of(part, [40.0, 40.0]), motion_of(part, [20.0, None])
    for j in range(2):
        for row, of_motion in zip(part.filtered(j, 40.0), (first.q, first.v, first.a), strict=True):
            assert np.shares_memory(row, of_motion)
    part.forget_filtered({40.0})
    assert not np.shares_memory(part.filtered(0, 40.0)[0], first.q)
    assert_allclose(part.filtered(0, 40.0)[0], first.q[0], rtol=0, atol=0)
    assert np.shares_memory(part.filtered(1, None)[2], second.a)
