"""Positions on straight lines between the samples of a slower clock, and none of encoders, plans and held samples."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scara_ident.arrays import Array
from scara_ident.recording.audit.interpolated import interpolated_positions
from scara_ident.recording.audit.samples import Samples
from scara_ident.robot.robot import load_robot
from tests.made_recordings import columns
from tests.recording.audit.made import Read, only


def between(signal: Array, time: Array, rate: float, digits: int | None) -> Array:
    """The signal as it is between samples at a rate, printed with so many digits after the point."""
    points = np.arange(time[0], time[-1] + 1.0 / rate, 1.0 / rate)
    found = np.interp(time, points, np.interp(points, time, signal))
    return found if digits is None else np.round(found, digits)


@pytest.mark.parametrize("digits", [None, 6])
@pytest.mark.parametrize("rate", [20.0, 60.0, 100.0])
def test_positions_between_slower_samples_are_said_with_their_rate(read: Read, rate: float, digits: int | None):
    made = columns(6000, 1e-3)
    time = np.arange(6000) * 1e-3
    for joint in ("joint1", "joint2"):
        made[f"{joint}.position"] = between(made[f"{joint}.position"], time, rate, digits)
    finding = only(read(made), "interpolated_position")
    assert finding.count == 2
    assert f"points {1.0 / rate:.2g}"[:11] in finding.message
    assert "give the samples as they were logged" in finding.message


@given(
    rate=st.sampled_from([100.0, 250.0, 1000.0]),
    step=st.sampled_from([0.0, 1e-6, 1e-4, 1e-3]),
    noise=st.sampled_from([0.0, 1e-6, 1e-4]),
    speed=st.floats(0.05, 2.0),
    seed=st.integers(0, 100),
)
def test_no_encoder_and_no_plan_is_said_to_be_interpolated(
    rate: float, step: float, noise: float, speed: float, seed: int
):
    """Cruises are straight lines too: a plan of trapezoidal speeds, and positions in steps of it."""
    count = 3000
    time, rng = np.arange(count) / rate, np.random.default_rng(seed)
    # To and fro with a ramp at either end of each way.
    phase = (time * speed) % 2.0
    way = np.where(phase < 1.0, phase, 2.0 - phase)
    smooth = np.convolve(np.pad(way, 40, mode="edge"), np.ones(81) / 81.0, "valid")
    position = 0.4 * smooth + np.array([[0.0], [0.1]]) + noise * rng.standard_normal((2, count))
    position = step * np.rint(position / step) if step else position
    samples = Samples("a.csv", load_robot(), time, position, None, np.arange(1, count + 1))
    assert interpolated_positions(samples) == (samples, [])
