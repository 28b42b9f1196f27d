from __future__ import annotations

import numpy as np

from scara_ident.model.regressor.derivative import derivative, gradient
from scara_ident.model.regressor.tracing import Scalar, Trace, compile_program, cos, sin


def evaluate(trace: Trace, value: Scalar, inputs: np.ndarray) -> np.ndarray:
    program = compile_program(trace, [(0, value)])
    out = np.zeros((1, inputs.shape[1]))
    program.evaluate(inputs, out, np.zeros((program.buffers, inputs.shape[1])))
    return out[0]


def test_every_operation_has_the_slope_of_a_complex_step() -> None:
    trace = Trace()
    x, y = trace.variable(0), trace.variable(1)

    def function(x, y, sin, cos, exp, tanh):
        return 3.0 * sin(x * y) - cos(2.0 * x - y) * x + exp(-x * x) * (y - x + 1.0) - y * tanh(y - 3.0 * x)

    value = function(x, y, sin, cos, lambda z: z.exp(), lambda z: z.tanh())
    inputs = np.random.default_rng(0).uniform(-2.0, 2.0, (2, 50))
    found = evaluate(trace, derivative([value], x)[0], inputs)
    step = function(inputs[0] + 1e-30j, inputs[1] + 0j, np.sin, np.cos, np.exp, np.tanh).imag / 1e-30
    np.testing.assert_allclose(found, step, rtol=1e-13, atol=1e-13)
    backwards = gradient([x * y, value], [0.0, 2.0], [x, y])
    np.testing.assert_allclose(evaluate(trace, backwards[0], inputs), 2.0 * step, rtol=1e-13, atol=1e-13)
    forwards = evaluate(trace, derivative([value], y)[0], inputs)
    np.testing.assert_allclose(evaluate(trace, backwards[1], inputs), 2.0 * forwards, rtol=1e-13, atol=1e-13)


def test_sizes_have_the_slope_of_their_sign_and_signs_none() -> None:
    trace = Trace()
    x, y = trace.variable(0), trace.variable(1)
    inputs = np.array([[-2.0, 0.0, 3.0], [1.0, 1.0, 1.0]])
    np.testing.assert_array_equal(evaluate(trace, derivative([abs(2.0 * x)], x)[0], inputs), [-2.0, 0.0, 2.0])
    (back,) = gradient([abs(2.0 * x), x.direction(), 4.0], [y, 1.0, 1.0], [x])
    np.testing.assert_array_equal(evaluate(trace, back, inputs), [-2.0, 0.0, 2.0])
    assert derivative([x.direction(), y * y, 4.0], x) == [0.0, 0.0, 0.0]
    assert derivative([-x, x - x], x) == [-1.0, 0.0]
