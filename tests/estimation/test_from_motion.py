"""Arrays to factors: the same as all rows at once, whatever the chunk."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from scara_ident import Motion, build_model, load_robot
from scara_ident.errors import RecordingError
from scara_ident.estimation.from_motion import MAX_CHUNK, MIN_CHUNK, chunk_of, information_of
from scara_ident.estimation.information import merge


def test_chunks_give_what_all_rows_at_once_give():
    model = build_model(load_robot(), "complete")
    assert MIN_CHUNK < chunk_of(model) <= MAX_CHUNK
    samples = 2 * chunk_of(model) + 700
    random = np.random.default_rng(0)
    q, v, a, torque = random.uniform(-2.0, 2.0, (4, 2, samples))
    motion = Motion("random", "random", np.arange(samples) / 1000.0, q, v, a, torque, 1000.0)
    found = information_of(model, motion)
    rows = model.regressor(motion)
    value, squares, *_ = np.linalg.lstsq(np.hstack(list(rows)).T, torque.ravel())
    whole = merge(found)
    assert_allclose(whole.solve().value, value, rtol=1e-11)
    assert whole.residual_sum() == pytest.approx(squares[0], rel=1e-12)
    assert [part.rows for part in found] == [samples, samples]
    for joint, part in enumerate(found):
        gram = rows[joint] @ rows[joint].T
        assert_allclose(part.regressor_factor.T @ part.regressor_factor, gram, atol=1e-13 * gram.max())


def test_without_torque_it_is_one_line():
    model = build_model(load_robot(), "basic")
    motion = Motion("still", "still", np.arange(4.0), *np.zeros((3, 2, 4)), None, 1.0)
    with pytest.raises(RecordingError, match="still: no effort was recorded"):
        information_of(model, motion)


def test_numbers_that_are_none_are_one_line():
    model = build_model(load_robot(), "basic")
    torque = np.ones((2, 100))
    torque[1, 50] = np.nan
    motion = Motion("torn", "torn", np.arange(100.0), *np.ones((3, 2, 100)), torque, 1.0)
    with pytest.raises(RecordingError, match="torn: NaN or infinite numbers in the equation of joint2"):
        information_of(model, motion)
