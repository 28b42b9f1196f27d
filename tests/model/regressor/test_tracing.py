"""The tracer: folding, sharing, signs, and the emitted code against plain evaluation."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scara_ident.model.regressor.tracing import Expr, Program, Scalar, Trace, compile_program, cos, sin, vanishing

INPUTS = 3


def run(program: Program, inputs: np.ndarray, targets: int) -> np.ndarray:
    outputs = np.full((targets, inputs.shape[1]), np.nan)
    program.evaluate(inputs, outputs, np.full((program.buffers, inputs.shape[1]), np.nan))
    return outputs


def variables(trace: Trace) -> list[Expr]:
    return [trace.variable(k) for k in range(INPUTS)]


def test_zeros_and_ones_and_constants_fold_away() -> None:
    x, y, _ = variables(trace := Trace())
    assert 0.0 * x == 0.0
    assert x - x == 0.0
    assert (1.0 * x + 0.0).node == x.node
    assert (-1.0 * x).sign == -1
    assert cos(0.0) == 1.0
    assert sin(0.0) == 0.0
    before = len(trace.nodes)
    assert (2.0 * (3.0 * x)).node == (6.0 * x).node
    assert ((x + 2.0) + 3.0).node == (x + 5.0).node
    assert len(trace.nodes) == before + 4
    assert (x * y).node == (y * x).node


def test_differences_and_their_negatives_share_one_node() -> None:
    x, y, _ = variables(Trace())
    difference, other = x - y, y - x
    assert difference.node == other.node
    assert difference.sign == -other.sign
    assert sin(-x).node == sin(x).node
    assert cos(-x).node == cos(x).node


def test_code_leaves_out_what_no_output_needs() -> None:
    x, y, _ = variables(trace := Trace())
    sin(x * y)
    program = compile_program(trace, [(0, x + y)])
    assert program.operations == 1
    assert "sin" not in program.source


def test_an_output_in_both_signs_and_twice_is_computed_once() -> None:
    x, y, _ = variables(trace := Trace())
    product = x * y
    program = compile_program(trace, [(0, -product), (1, product), (2, -product), (3, product + 1.0), (4, -x)])
    assert program.source.count("mul(") == 1
    inputs = np.array([[2.0, -3.0], [5.0, 7.0], [0.0, 0.0]])
    p = inputs[0] * inputs[1]
    np.testing.assert_array_equal(run(program, inputs, 5), [-p, p, -p, p + 1, -inputs[0]])


def test_vectors_are_reused_after_their_last_use() -> None:
    x, y, _ = variables(trace := Trace())
    value: Scalar = x
    for k in range(50):
        value = (value + y) * (1.0 + k / 50.0)
    assert compile_program(trace, [(0, value)]).buffers == 1


def test_a_constant_output_is_written() -> None:
    trace = Trace()
    program = compile_program(trace, [(1, 2.5)])
    np.testing.assert_array_equal(run(program, np.zeros((INPUTS, 3)), 2)[1], 2.5)


def test_vanishing_finds_identities_and_keeps_small_values() -> None:
    x, y, _ = variables(trace := Trace())
    c, s = cos(x), sin(x)
    values = [c * c + s * s - 1.0, c * s - 0.5 * sin(2.0 * x), 1e-11 * y, c * c + s * s, 0.0, 2.0]
    inputs = np.random.default_rng(0).normal(size=(INPUTS, 8))
    assert vanishing(trace, values, inputs) == [True, True, False, False, True, False]


Build = Callable[[list[Scalar]], Scalar]
BINARY: list[Callable[[Scalar, Scalar], Scalar]] = [operator.add, operator.sub, operator.mul]
STEP = st.tuples(
    st.sampled_from(["+", "-", "*", "neg", "sin", "cos", "const"]),
    st.integers(0, 10**6),
    st.integers(0, 10**6),
    st.sampled_from([-1.0, 0.0, 1.0, 0.5, -2.0, math.pi]),
)


@pytest.mark.slow
@settings(max_examples=150)
@given(steps=st.lists(STEP, min_size=1, max_size=40), picks=st.lists(st.integers(0, 10**6), min_size=1, max_size=6))
def test_emitted_code_gives_what_plain_evaluation_gives(
    steps: list[tuple[str, int, int, float]], picks: list[int]
) -> None:
    inputs = np.random.default_rng(3).uniform(-1.5, 1.5, (INPUTS, 7))
    trace = Trace()
    traced: list[Scalar] = list(variables(trace))
    plain: list[np.ndarray] = list(inputs)
    for kind, i, j, constant in steps:
        i, j = i % len(traced), j % len(traced)
        if kind in "+-*":
            function = BINARY["+-*".index(kind)]
            new, value = function(traced[i], traced[j]), function(plain[i], plain[j])
        elif kind == "neg":
            new, value = -traced[i], -plain[i]
        elif kind == "const":
            new, value = constant * traced[i] + constant, constant * plain[i] + constant
        else:
            new = sin(traced[i]) if kind == "sin" else cos(traced[i])
            value = np.sin(plain[i]) if kind == "sin" else np.cos(plain[i])
        if np.max(np.abs(value)) < 1e3:
            traced.append(new)
            plain.append(value * np.ones(7))
    chosen = [pick % len(traced) for pick in picks]
    program = compile_program(trace, [(k, traced[index]) for k, index in enumerate(chosen)])
    expected = np.array([plain[index] for index in chosen])
    result = run(program, inputs, len(chosen))
    assert result == pytest.approx(expected, rel=1e-9, abs=1e-9)
