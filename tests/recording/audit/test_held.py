"""Rows that repeat the row before, in motion and at rest."""

from __future__ import annotations

import re

import numpy as np
import pytest

from scara_ident.recording.audit import Samples
from scara_ident.recording.audit.held import held_rows, stale_positions
from scara_ident.robot.robot import load_robot
from tests.made_recordings import columns
from tests.recording.audit.made import only

ROBOT = load_robot()


def noisy(seed: int, count: int = 727, rate: float = 30.0, step: float = 1e-7) -> Samples:
    """Two joints that always move, with noise of their encoders and efforts."""
    random = np.random.default_rng(seed)
    time = np.arange(count) / rate
    position = np.array([np.sin(1.1 * time + 0.3), 0.8 * np.sin(1.7 * time) + 0.2 * np.cos(0.6 * time)])
    position = step * np.rint((position + 2.0 * step * random.standard_normal(position.shape)) / step)
    effort = np.cos(1.3 * time) + 0.01 * random.standard_normal(position.shape)
    return Samples("a.csv", ROBOT, time, position, effort, np.arange(1, count + 1))


def with_copies(samples: Samples, at: np.ndarray, efforts: bool = True) -> Samples:
    """Return the samples with some rows that hold what the row before does."""
    position, effort = samples.position.copy(), samples.effort.copy()
    position[:, at] = position[:, at - 1]
    if efforts:
        effort[:, at] = effort[:, at - 1]
    return Samples(samples.source, samples.robot, samples.time, position, effort, samples.row)


@pytest.mark.parametrize("hold", [2, 5])
def test_a_logger_faster_than_its_source_is_thinned_to_the_source(read, hold):
    made = columns()
    held = {n: (v if n == "time" else v[np.arange(4000) // hold * hold]) for n, v in made.items()}
    recording = read(held)
    finding = only(recording, "held_samples")
    assert finding.count == 4000 - 4000 // hold
    assert recording.rate == pytest.approx(1000 / hold)
    np.testing.assert_array_equal(recording.effort[1], made["joint2.effort"][::hold])


def test_scattered_held_rows_are_left_out(read):
    made = columns()
    late = np.sort(np.random.default_rng(2).choice(np.arange(1, 4000), 300, replace=False))
    for name, values in made.items():
        if name != "time":
            for i in late:
                values[i] = values[i - 1]
    finding = only(read(made), "held_samples")
    assert finding.count == 300


def test_a_stalled_logger_leaves_a_gap(read):
    made = columns()
    for name, values in made.items():
        if name != "time":
            values[1000:1300] = values[1000]
    recording = read(made)
    finding = only(recording, "freeze")
    assert finding.count == 299
    assert "row 1001" in finding.message
    assert np.max(np.diff(recording.time)) == pytest.approx(0.3)


def test_quantised_slow_motion_with_quantised_effort_is_not_called_held(read):
    made = columns(interval=2e-3)
    for name, values in made.items():
        if name.endswith("effort"):
            values[:] = 0.02 * np.rint(values / 0.02)
        elif name.endswith("position"):
            values[:] = 0.01 * np.rint(values / 0.01)
    same = np.all([np.diff(v) == 0 for n, v in made.items() if n != "time"], axis=0)
    assert same.mean() > 0.02
    assert read(made).findings == ()


def test_an_arm_that_rests_between_motions_without_noise_is_not_called_held_or_frozen(read):
    time = 1e-3 * np.arange(6000)
    s = np.clip(np.concatenate([np.linspace(0, 1, 2000), np.ones(1000), np.linspace(1, 0, 2000), np.zeros(1000)]), 0, 1)
    smooth = 10 * s**3 - 15 * s**4 + 6 * s**5
    force = np.gradient(np.gradient(smooth, 1e-3), 1e-3)
    made = {"time": time}
    for joint in ("joint1", "joint2"):
        made[f"{joint}.position"], made[f"{joint}.effort"] = 0.5 + smooth, 0.1 * force
    assert read(made).findings == ()


@pytest.mark.parametrize("count", [2, 5, 14])
def test_a_few_copies_of_noisy_channels_in_motion_are_none_of_chance(count):
    """14 of 727 were just below 2 %, and nothing was said of them."""
    at = np.arange(20, 700, 680 // count)[:count]
    samples, (finding,) = held_rows(with_copies(noisy(1), at))
    np.testing.assert_array_equal(np.setdiff1d(np.arange(727), samples.row - 1), at)
    assert (finding.kind, finding.count) == ("held_samples", count)
    assert finding.message.startswith(f"{count} of 727 rows repeat the row before in every channel")
    # A log about as fast as its source tells no rate of it.
    assert finding.message.endswith("left out")


def test_noise_that_repeats_a_position_now_and_then_is_no_copy():
    for seed in range(10):
        samples = noisy(seed, count=4000, rate=500.0, step=1e-4)
        assert np.any(np.diff(samples.position[0]) == 0)
        assert held_rows(samples) == (samples, [])
        assert stale_positions(samples) == (samples, [])


def coarse(seed: int) -> Samples:
    """Encoders whose steps last many rows, and efforts in steps above their noise."""
    made = noisy(seed, count=8000, rate=1000.0)
    position, effort = 6e-3 * np.rint(made.position / 6e-3), 0.05 * np.rint(made.effort / 0.05)
    return Samples(made.source, made.robot, made.time, position, effort, made.row)


def test_a_coarse_encoder_read_within_a_step_repeats_no_row():
    """Positions repeat where efforts do as often as where they do not; what does both was left out, which cut the recording."""
    for seed in range(5):
        samples = coarse(seed)
        assert np.mean(samples.repeats()) > 0.3
        assert held_rows(samples) == (samples, [])


def test_copies_beside_a_coarse_encoder_are_left_out():
    at = np.arange(1, 8000, 2)
    samples, (finding,) = held_rows(with_copies(coarse(1), at))
    assert finding.count >= len(at)
    assert not np.isin(at + 1, samples.row).any()


def braking() -> Samples:
    """It brakes for five seconds; then nothing changes."""
    made = noisy(2, count=2000)
    braked = np.cumsum(np.clip((50.0 - made.time) / 5.0, 0.0, 1.0)) / 30.0
    random = np.random.default_rng(5)
    made.position[:] = np.sin([1.1 * braked + 0.3, 1.7 * braked]) + 1e-7 * random.standard_normal(made.position.shape)
    for signal in (made.position, made.effort):
        signal[:, 1500:] = signal[:, 1499:1500]
    return made


def test_a_rest_without_noise_stays_where_a_few_rows_are_copied():
    samples, (finding,) = held_rows(with_copies(braking(), np.arange(100, 1400, 130)))
    assert finding.count == 10
    assert np.count_nonzero(samples.row > 1500) == 500


def test_copies_where_the_arm_stands_are_not_counted_as_in_motion():
    """1282 rows were said to repeat while the arm moves, which it did in 96 of them."""
    samples, (finding,) = held_rows(with_copies(braking(), np.arange(101, 1400, 2)))
    assert finding.count == 2000 - samples.count == 650 + 500
    said = re.match(
        r"1150 of 2000 rows repeat the row before in every channel, (\d+) of them while the arm moves, first row 102 ",
        finding.message,
    )
    # Near its turning points and before its rest it is slow.
    assert said is not None
    assert 600 <= int(said[1]) <= 655
    assert "Hz" not in held_rows(with_copies(noisy(1), np.arange(20, 700, 20)))[1][0].message
    assert "15 Hz" in held_rows(with_copies(noisy(1), np.arange(1, 727, 2)))[1][0].message


def test_positions_that_are_late_under_new_efforts_are_left_out():
    """A step of nothing, between two of an interval, is none that an even clock can have."""
    at = np.arange(30, 700, 60)
    made = with_copies(noisy(3), at, efforts=False)
    assert held_rows(made) == (made, [])
    samples, (finding,) = stale_positions(made)
    np.testing.assert_array_equal(np.setdiff1d(np.arange(727), samples.row - 1), at)
    assert (finding.kind, finding.count) == ("stale_positions", len(at))
    assert "rows have the positions of the row before while the arm moves, first row 31 " in finding.message


def test_of_a_joint_that_moves_alone_no_late_position_is_determined():
    made = noisy(4)
    made.position[1] = 0.3
    made = with_copies(made, np.arange(30, 700, 60), efforts=False)
    assert stale_positions(made) == (made, [])


@pytest.mark.parametrize("bits", range(10, 21, 2))
def test_coarse_encoders_without_noise_are_not_late(bits):
    """All joints start and stop together: all positions repeat at once while they are slow."""
    time = 2e-3 * np.arange(6000)
    s = np.clip(np.concatenate([np.linspace(0, 1, 2500), np.ones(500), np.linspace(1, 0, 2500), np.zeros(500)]), 0, 1)
    smooth = 10 * s**3 - 15 * s**4 + 6 * s**5
    step = 2 * np.pi / 2**bits
    position = step * np.rint(np.array([smooth, 0.7 * smooth]) / step)
    effort = np.gradient(np.gradient(smooth, 2e-3), 2e-3) * np.array([[1.0], [0.6]])
    samples = Samples("a.csv", ROBOT, time, position, effort, np.arange(1, 6001))
    assert held_rows(samples) == (samples, [])
    assert stale_positions(samples) == (samples, [])
