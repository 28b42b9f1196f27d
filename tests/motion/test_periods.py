"""Where a motion comes again within a recording."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scara_ident.motion.motion import Stretch
from scara_ident.motion.periods import periods_of


def stretch(position: np.ndarray, rate: float) -> Stretch:
    time = np.arange(position.shape[1]) / rate
    return Stretch("P_1", "P", time, position, None, rate, slice(0, len(time)))


def waves(time: np.ndarray, period: float, seed: int = 1, joints: int = 3) -> np.ndarray:
    rng = np.random.default_rng(seed)
    order = np.arange(1, 5)
    size, phase = rng.normal(size=(joints, 4)) / order, rng.uniform(0.0, 6.0, (joints, 4, 1))
    return np.einsum("jk,jkt->jt", size, np.sin(2.0 * np.pi * order[:, None] / period * time + phase))


def faded(position: np.ndarray, rate: float, seconds: float = 1.2) -> np.ndarray:
    """The same motion from a pose of rest and back to it."""
    count = position.shape[1]
    edge = np.minimum(np.arange(count), count - 1 - np.arange(count)) / (rate * seconds)
    return position * np.clip(edge, 0.0, 1.0) ** 2


@settings(deadline=None, max_examples=25)
@given(
    period=st.floats(3.0, 9.0),
    count=st.floats(3.1, 6.0),
    rate=st.sampled_from([50.0, 125.0, 333.0, 1000.0]),
    bits=st.sampled_from([12, 20]),
    seed=st.integers(0, 99),
)
def test_whole_periods_are_found_between_the_way_to_the_path_and_back(period, count, rate, bits, seed):
    time = np.arange(int((period * count + 2.4) * rate)) / rate
    step = 2.0 * np.pi / 2**bits
    position = step * np.round(faded(waves(time, period, seed), rate) / step)
    found = periods_of(stretch(position, rate))
    assert found is not None
    assert found.length == pytest.approx(period * rate, rel=0.03)
    assert np.diff(found.starts) == pytest.approx(period * rate, abs=0.01 * rate + 1.0)
    # Those at the ends are cut, and may hold less than a period.
    assert int(count) - 1 <= len(found.starts) <= int(count + 1)
    assert found.starts[-1] + found.length <= position.shape[1]
    pieces = [position[:, start : start + found.length] for start in found.starts]
    spread = np.ptp(position, axis=1)[:, None]
    assert all(np.sqrt(np.mean(((piece - pieces[0]) / spread) ** 2)) < 0.03 for piece in pieces)


@pytest.mark.parametrize(
    "made",
    [
        pytest.param(lambda time: np.vstack([np.sin(0.3 * time + 0.08 * time**2), np.cos(0.1 * time**2)]), id="sweep"),
        pytest.param(lambda time: waves(time, 14.0), id="one and a half"),
        pytest.param(lambda time: np.vstack([np.sin(time), np.sin(np.sqrt(2.0) * time)]), id="never again"),
        pytest.param(lambda time: np.zeros((2, len(time))), id="standing"),
        pytest.param(lambda time: np.vstack([time, 0.5 * time]), id="on and on"),
        pytest.param(lambda time: waves(time, 5.0)[:, :3], id="three samples"),
    ],
)
def test_of_other_motions_none_is_said(made):
    assert periods_of(stretch(made(np.arange(2000) / 100.0), 100.0)) is None


def test_a_joint_at_rest_beside_others_does_not_hide_a_period():
    time = np.arange(2500) / 100.0
    noise = 1e-5 * np.random.default_rng(2).standard_normal(len(time))
    found = periods_of(stretch(np.vstack([waves(time, 6.0), noise]), 100.0))
    assert found is not None and found.length == pytest.approx(600, abs=2) and len(found.starts) == 4
