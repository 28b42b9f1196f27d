"""The steps of an encoder, found in recorded positions."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scara_ident.motion.encoder_steps import encoder_step

TIME = np.arange(4000) / 500.0
SMOOTH = np.vstack([np.sin(1.3 * TIME), 0.5 * np.cos(2.1 * TIME)])


@given(bits=st.integers(10, 16), zero=st.floats(-1.0, 1.0), single=st.booleans())
def test_the_step_of_an_encoder_is_found(bits: int, zero: float, single: bool):
    step = 2.0 * np.pi / 2**bits
    position = step * np.round((SMOOTH[0] + zero) / step)
    if single:
        position = position.astype(np.float32).astype(float)
    found = encoder_step(position)
    # Finer steps are taken hundreds at a time, and are white noise.
    assert found == pytest.approx(step, rel=0.02)


def test_without_steps_there_are_none():
    rng = np.random.default_rng(0)
    assert encoder_step(SMOOTH[0]) is None
    assert encoder_step(SMOOTH[0] + 1e-4 * rng.standard_normal(len(TIME))) is None
    assert encoder_step(np.zeros(100)) is None
