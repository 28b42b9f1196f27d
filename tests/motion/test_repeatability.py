"""The noise floor from repetitions of one trajectory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from scara_ident.motion.prepared import prepare
from scara_ident.motion.repeatability import repeatability
from scara_ident.recording.recording import Recording
from scara_ident.robot.robot import Robot, load_robot
from tests.arms import recording

RATE = 500.0
SIGMA = np.array([0.02, 0.008])


@pytest.fixture(scope="module")
def robot() -> Robot:
    return load_robot()


def run(robot: Robot, name: str, seed: int, start: float = 0.0, seconds: float = 10.0, pace: float = 1.0) -> Recording:
    """One repetition whose motion begins ``start`` seconds into the trajectory."""
    rng = np.random.default_rng(seed)
    time = np.arange(round(seconds * RATE)) / RATE
    s = pace * (time + start)
    q = np.array([np.sin(1.9 * s) + 0.4 * np.sin(3.1 * s), np.cos(1.3 * s) + 0.3 * np.sin(4.3 * s)])
    torque = np.array([2.0 * np.sin(2.0 * s), np.cos(3.0 * s)]) + SIGMA[:, None] * rng.standard_normal(q.shape)
    return recording(robot, name, time, q + 1e-5 * rng.standard_normal(q.shape), torque)


def repeats(recordings: Sequence[Recording]) -> dict[str, NDArray[np.float64]]:
    return repeatability(prepare(recordings))


def test_known_noise_is_found(robot: Robot):
    found = repeats([run(robot, f"a_{k}", k) for k in range(3)])
    assert list(found) == ["a"]
    np.testing.assert_allclose(found["a"], SIGMA, rtol=0.05)


@pytest.mark.parametrize("seconds", [3.0, 10.0])
def test_repetitions_that_start_at_another_moment_are_aligned(robot: Robot, seconds: float):
    runs = [run(robot, f"a_{k}", k, start, seconds) for k, start in enumerate((0.0, 0.3, -0.25))]
    np.testing.assert_allclose(repeats(runs)["a"], SIGMA, rtol=0.1)


def test_repetitions_of_different_length_are_compared_where_both_are(robot: Robot):
    runs = [run(robot, "a_1", 1, seconds=10.0), run(robot, "a_2", 2, start=0.2, seconds=8.0)]
    np.testing.assert_allclose(repeats(runs)["a"], SIGMA, rtol=0.1)
    np.testing.assert_allclose(repeats(runs[::-1])["a"], SIGMA, rtol=0.1)


def test_jittered_repetitions_are_compared_all_the_same(robot: Robot):
    runs = []
    for k in range(2):
        clean = run(robot, f"a_{k}", k)
        shift = 0.1 / RATE * np.random.default_rng(k).uniform(-1, 1, len(clean.time))
        runs.append(replace(clean, time=clean.time + shift))
    np.testing.assert_allclose(repeats(runs)["a"], SIGMA, rtol=0.15)


def test_another_motion_of_the_same_name_is_not_taken(robot: Robot):
    assert repeats([run(robot, "a_1", 1), run(robot, "a_2", 2, pace=1.2)]) == {}
    found = repeats([run(robot, "a_1", 1), run(robot, "a_2", 2, pace=1.2), run(robot, "a_3", 3)])
    np.testing.assert_allclose(found["a"], SIGMA, rtol=0.05)


def test_an_odd_first_run_does_not_hide_the_repetitions(robot: Robot):
    found = repeats([run(robot, "a_1", 1, pace=1.2), run(robot, "a_2", 2), run(robot, "a_3", 3)])
    np.testing.assert_allclose(found["a"], SIGMA, rtol=0.05)


def test_trajectories_are_judged_apart(robot: Robot):
    paces = {"a_1": 1.0, "a_2": 1.0, "b_1": 1.2, "b_2": 1.2, "c_1": 0.8}
    runs = [run(robot, name, k, pace=pace) for k, (name, pace) in enumerate(paces.items())]
    runs[2] = replace(runs[2], effort=3 * runs[2].effort - 2 * run(robot, "b_1", 77, pace=1.2).effort)
    found = repeats(runs)
    assert set(found) == {"a", "b"}
    assert np.all(found["b"] > 2.0 * found["a"])


def test_without_repetitions_or_effort_nothing_is_said(robot: Robot):
    assert repeats([]) == {}
    assert repeats([run(robot, "a_1", 1)]) == {}
    assert repeats([replace(run(robot, f"a_{k}", k), effort=None) for k in range(2)]) == {}
