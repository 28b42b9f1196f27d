"""The noise of positions: steps of encoders, white noise, and recordings that have it twice."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, lfilter

from scara_ident.errors import RecordingError
from scara_ident.identification.identify import identify
from scara_ident.motion.position_noise import (
    coarse_positions,
    forget_noisier,
    noise_level,
    noise_sizes,
    noisier,
    stamp_rounding,
    unresolved_joints,
)
from scara_ident.motion.prepared import prepare
from scara_ident.robot.robot import load_robot
from tests.arms import recording

TIME = np.arange(4000) / 500.0
SMOOTH = np.vstack([np.sin(1.3 * TIME), 0.5 * np.cos(2.1 * TIME)])


def prepared(position: np.ndarray):
    made = recording(load_robot(), "M_1", TIME, position, np.zeros_like(position))
    return prepare([made], (10.0, 10.0))


@pytest.mark.parametrize("size", [1e-5, 1e-3])
def test_white_noise_is_measured_and_added_once_more(size: float):
    rng = np.random.default_rng(1)
    data = prepared(SMOOTH + size * rng.standard_normal(SMOOTH.shape))
    (part,) = data.stretches
    for joint in range(2):
        assert noise_level(part, joint) == pytest.approx(size, rel=0.1)
    (more,) = noisier(data).stretches
    added = more.stretch.position - part.stretch.position
    assert np.std(added, axis=1) == pytest.approx([size, size], rel=0.1)
    assert np.array_equal(more.torque, part.torque)
    assert noisier(data) is noisier(data)
    before = noisier(data)
    forget_noisier(data)
    assert noisier(data) is not before
    assert np.array_equal(noisier(data).stretches[0].stretch.position, more.stretch.position)


def test_steps_are_added_about_another_zero_and_follow_the_motion():
    step = 2.0 * np.pi / 2**12
    data = prepared(step * np.round(SMOOTH / step))
    (part,) = data.stretches
    (more,) = noisier(data, seed=3).stretches
    added = more.stretch.position - part.stretch.position
    assert np.max(np.abs(added)) <= 0.5 * step * (1.0 + 1e-9)
    assert np.std(added[0]) == pytest.approx(step / np.sqrt(12.0), rel=0.05)
    assert abs(np.corrcoef(added[0], part.stretch.position[0] - SMOOTH[0])[0, 1]) < 0.2
    again = noisier(replace(data), seed=3).stretches[0].stretch.position
    assert np.array_equal(again, more.stretch.position)


@pytest.mark.parametrize(("counts", "white"), [(0.0, False), (0.2, False), (1.5, True), (4.0, True)])
def test_an_encoder_that_scatters_over_its_steps_has_white_noise_beside_them(counts: float, white: bool):
    """A resolver of some counts of noise: the rounding of its steps was all the noise it was believed to have."""
    step = 2.0 * np.pi / 2**16
    rng = np.random.default_rng(2)
    data = prepared(step * np.round(SMOOTH / step + counts * rng.standard_normal(SMOOTH.shape)))
    ((sizes,),) = noise_sizes(data)
    # Noise of a step and more leaves nothing of the rounding but its variance.
    expected = counts * step if white else 0.0
    assert sizes == ((pytest.approx(step), pytest.approx(expected, rel=0.1)),) * 2
    (more,) = noisier(data).stretches
    added = np.std(more.stretch.position - data.stretches[0].stretch.position, axis=1)
    assert added == pytest.approx([np.hypot(expected, step / np.sqrt(12.0))] * 2, rel=0.15)


@pytest.mark.parametrize("counts", [0.0, 2.0])
def test_a_joint_that_swings_beyond_its_band_has_no_more_noise_for_it(counts: float):
    """A fifth of the rate is within what noise is measured in: a swing there was taken for noise at all frequencies."""
    step = 2.0 * np.pi / 2**16
    rng = np.random.default_rng(2)
    swing = 8.0 * np.sin(2.0 * np.pi * 0.2 * np.arange(len(TIME)))
    data = prepared(step * np.round(SMOOTH / step + swing + counts * rng.standard_normal(SMOOTH.shape)))
    assert noise_level(data.stretches[0], 0) > 2.0 * max(counts, 1.0) * step
    ((sizes,),) = noise_sizes(data)
    assert sizes == ((pytest.approx(step), pytest.approx(counts * step, rel=0.1)),) * 2


def _ringing() -> np.ndarray:
    """A swing of 60 Hz that dies away within a quarter of a second, begun anew every 0.8 s."""
    since = np.mod(TIME, 0.8)
    return 5e-4 * np.exp(-19.0 * since) * np.sin(2.0 * np.pi * 60.0 * since)


@pytest.mark.parametrize("size", [0.0, 2e-6])
def test_without_steps_what_is_quiet_at_times_is_no_noise(size: float):
    rng = np.random.default_rng(6)
    data = prepared(SMOOTH + _ringing() + size * rng.standard_normal(SMOOTH.shape))
    ((sizes,),) = noise_sizes(data)
    # Of a position without noise a fiftieth of what the swing was taken for.
    rest = 0.01 * float(np.std(_ringing())) if size == 0.0 else 0.15 * size
    assert [level for _, level in sizes] == pytest.approx([size, size], abs=rest)


@given(share=st.floats(0.1, 0.3), order=st.integers(1, 2))
@settings(max_examples=10, deadline=None)
def test_filtered_noise_without_steps_stays_noise(share: float, order: int):
    """It is not at the highest frequencies, as a swing is not; but it is there at all times."""
    rng = np.random.default_rng(7)
    noise = lfilter(*butter(order, 2.0 * share), 1e-4 * rng.standard_normal(SMOOTH.shape), axis=1)
    data = prepared(SMOOTH + noise)
    ((sizes,),) = noise_sizes(data)
    for joint, (_, level) in enumerate(sizes):
        assert level > 0.75 * noise_level(data.stretches[0], joint)


def test_noise_that_grows_with_speed_stays_noise_where_it_is_white():
    """As of stamps of few digits on an uneven clock: at the quietest there is little of it."""
    rng = np.random.default_rng(8)
    data = prepared(SMOOTH + 1e-4 * np.gradient(SMOOTH, TIME, axis=1) * rng.standard_normal(SMOOTH.shape))
    ((sizes,),) = noise_sizes(data)
    for joint, (_, level) in enumerate(sizes):
        assert level > 0.85 * noise_level(data.stretches[0], joint)


@pytest.mark.parametrize("band", [None, 0.13])
def test_steps_are_added_where_the_band_is_so_wide_that_positions_keep_them(band: float | None):
    """Those of a hardly filtered position are no further noise: it was moved as a whole."""
    step = 2.0 * np.pi / 2**12
    data = prepared(step * np.round(SMOOTH / step))
    rate = data.stretches[0].stretch.rate
    data = data.at((None if band is None else band * rate,) * 2)
    (part,) = data.stretches
    (more,) = noisier(data, seed=3).stretches
    added = more.stretch.position - part.stretch.position
    assert np.std(added[0]) == pytest.approx(step / np.sqrt(12.0), rel=0.1)
    assert abs(np.corrcoef(added[0], part.stretch.position[0] - SMOOTH[0])[0, 1]) < 0.2


@pytest.mark.parametrize(("bits", "band", "coarse"), [(10, 50.0, True), (10, 3.0, False), (16, 50.0, False)])
def test_an_encoder_too_coarse_for_its_band_is_named(bits: int, band: float, coarse: bool):
    step = 2.0 * np.pi / 2**bits
    position = np.vstack([step * np.round(SMOOTH[0] / step), SMOOTH[1]])
    item = recording(load_robot(), "M_1", TIME, position, np.sin(3.0 * position))
    said = coarse_positions(prepare([item], (band, band)).recordings[0], lambda _: "rad")
    if not coarse:
        assert said is None
        return
    assert said is not None
    assert f"positions of joint1 go in steps of {step:.2g} rad, so coarse" in said
    with pytest.raises(RecordingError, match="finer encoder"):
        identify(load_robot(), [replace(item, position=step * np.round(SMOOTH / step))], bands=[band, band])


def test_a_joint_that_hardly_moves_is_to_be_moved_and_the_other_to_have_a_finer_encoder():
    """As coarse for its band: of an encoder of 17 bits a finer one was asked for, where the joint trembled by 34 of its steps."""
    coarse, fine = 2.0 * np.pi / 2**10, 2.0 * np.pi / 2**17
    little = 1e-3 * SMOOTH[1]
    position = np.vstack([coarse * np.round(SMOOTH[0] / coarse), fine * np.round(little / fine)])
    item = recording(load_robot(), "M_1", TIME, position, np.sin(3.0 * position))
    said = coarse_positions(prepare([item], (50.0, 50.0)).recordings[0], ("rad", "m").__getitem__)
    assert said is not None
    first, second = said.split("; positions of ")
    assert first.startswith(
        f"positions of joint2 move by {np.ptp(position[1]):.2g} m in all, in steps of {fine:.2g} m, so little"
    )
    assert "move further and faster" in first
    assert "finer" not in first
    assert second.startswith("joint1 go in steps")
    assert "finer encoder" in second


@pytest.mark.parametrize(("swing", "share", "unresolved"), [(3e-3, 1.0, True), (3e-3, 0.4, False), (1e-5, 1.0, False)])
def test_a_joint_that_shakes_beyond_the_rate_is_not_resolved(swing: float, share: float, unresolved: bool):
    # 72 Hz at 125 samples a second look like 53 Hz.
    time = TIME[: TIME.size // 4 * 4 : 4]
    still = SMOOTH[:, ::4].copy()
    shaken = still + np.vstack([swing * np.sin(2.0 * np.pi * 72.0 * time), np.zeros_like(time)])
    size = round(share * len(time))
    runs = [
        recording(load_robot(), name, time[:count], position[:, :count], np.zeros((2, count)))
        for name, position, count in (("A_1", shaken, size), ("B_1", still, len(time) - size))
        if count
    ]
    assert set(unresolved_joints(prepare(runs, (25.0, 25.0)))) == ({0} if unresolved else set())


@pytest.mark.parametrize(("swing", "noise", "shaken"), [(3.0, 0.0, True), (0.3, 0.0, False), (0.0, 3.0, False)])
def test_where_one_joint_shakes_with_more_torque_than_it_moves_with_none_is_resolved(
    swing: float, noise: float, shaken: bool
):
    # A controller's limit cycle of 57 Hz at 200 samples a second, on the first joint of which 2 mrad follow.
    time = np.arange(1600) / 200.0
    wave = np.sin(2.0 * np.pi * 57.0 * time)
    motion = np.vstack([np.sin(1.3 * time), 0.5 * np.cos(2.1 * time)])
    torque = 2.0 * motion
    torque[0] += swing * wave + noise * np.random.default_rng(5).standard_normal(len(time))
    motion[0] -= 7e-4 * swing * wave
    data = prepare([recording(load_robot(), "M_1", time, motion, torque)], (25.0, 25.0))
    found = unresolved_joints(data)
    assert set(found) == ({0, 1} if shaken else set())
    assert not shaken or "the torque of joint1 oscillates more above 40 Hz" in found[1]


@pytest.mark.parametrize(("size", "shaken"), [(1.0, {0, 1}), (0.01, {0})])
def test_a_joint_that_shakes_with_little_torque_shakes_no_other(size: float, shaken: set[int]):
    """A TIAGo's wrist, that read 0.002 N m, was said to shake all seven joints and the torso, which had 0.3 N m and more."""
    time = np.arange(1600) / 200.0
    wave = np.sin(2.0 * np.pi * 57.0 * time)
    motion = np.vstack([np.sin(1.3 * time), 0.5 * np.cos(2.1 * time)])
    torque = np.vstack([size * (motion[0] + 3.0 * wave), 2.0 * motion[1]])
    motion[0] -= 2e-3 * wave
    data = prepare([recording(load_robot(), "M_1", time, motion, torque)], (25.0, 25.0))
    assert set(unresolved_joints(data)) == shaken


def _uneven(tick: float) -> np.ndarray:
    """Times of an uneven clock of 125 samples a second, at whole ticks where there are any."""
    interval = np.random.default_rng(9).uniform(0.6, 1.4, 1500) / 125.0
    return np.cumsum(tick * np.round(interval / tick) if tick else interval)


@pytest.mark.parametrize(("tick", "digits", "noisy"), [(0.0, 1e-3, True), (0.0, 1e-6, False), (2e-3, 1e-3, False)])
def test_rounded_stamps_of_an_uneven_clock_are_noise_of_the_positions(tick: float, digits: float, noisy: bool):
    """An arm without an elastic joint had two found: a spline through uneven samples hides half of the noise where it is measured."""
    time = _uneven(tick)
    position = np.vstack([np.sin(6.0 * time), 0.5 * np.cos(7.0 * time)])
    stamps = digits * np.round(time / digits)
    data = prepare([recording(load_robot(), "M_1", stamps, position, np.zeros_like(position))], (8.0, 8.0))
    ((sizes,),) = noise_sizes(data)
    speeds = np.array([6.0, 3.5]) / np.sqrt(2.0)
    made = speeds * digits / np.sqrt(12.0)
    for (_, level), size in zip(sizes, made, strict=True):
        # Speed is the rms of moving samples.
        assert level == pytest.approx(size, rel=0.1) if noisy else level < 0.2 * speeds[0] * 1e-3 / np.sqrt(12.0)


def test_stamps_of_an_even_clock_are_not_rounded():
    even = np.arange(1000) * 0.008
    assert stamp_rounding(even) == 0.0
    lost = np.delete(even, [100, 300, 301])
    assert stamp_rounding(lost) == 0.0
    assert stamp_rounding(1e-3 * np.round(_uneven(0.0) / 1e-3)) == pytest.approx(1e-3)
    assert stamp_rounding(_uneven(0.0)) == 0.0
