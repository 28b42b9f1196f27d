from __future__ import annotations

import numpy as np
import pytest

from scara_ident.export.traced_array import TracedArray, traced
from scara_ident.model.regressor.tracing import Trace, compile_program


def test_code_for_numbers_records_what_it_does() -> None:
    def code(x: np.ndarray) -> np.ndarray:
        columns = np.zeros_like(x)
        columns[0] = np.sign(x[1]) * np.exp(-((x[0] / 0.3) ** 2)) + 0.5 * np.abs(x[2])
        columns[1] = np.square(x[0]) - np.array([2.0]) * np.cos(x[1])
        np.sign(x[0], out=columns[2])
        columns[2] *= x[2] * x[2]
        return np.array([[1.0, 2.0, 0.0], [0.0, 1.0, -1.0]]) @ columns

    trace = Trace()
    recorded = code(traced([[trace.variable(k)] for k in range(3)]))
    assert isinstance(recorded, TracedArray)
    program = compile_program(trace, list(enumerate(recorded[:, 0].tolist())))
    inputs = np.random.default_rng(0).normal(size=(3, 20))
    inputs[:, 0] = 0.0
    out = np.zeros((2, 20))
    program.evaluate(inputs, out, np.zeros((program.buffers, 20)))
    np.testing.assert_allclose(out, code(inputs), rtol=1e-14, atol=1e-15)


def test_expressions_lie_below_infinity_and_below_nothing_else() -> None:
    x = traced([Trace().variable(0), 2.0])
    assert np.all(np.asarray(x < np.inf))
    with pytest.raises(TypeError, match="not known while it is recorded"):
        _ = x < 3.0
    np.testing.assert_array_equal(np.asarray(np.sin(traced([0.5, -0.5])), dtype=float), np.sin([0.5, -0.5]))
