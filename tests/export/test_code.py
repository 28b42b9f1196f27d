from __future__ import annotations

import math

import numpy as np

from scara_ident.export.code import PYTHON, code_lines, constants, docstring, function, inputs_of, numbers
from scara_ident.model.regressor.tracing import Trace, cos, sin


def test_code_does_what_was_recorded_and_its_output_may_be_an_input() -> None:
    trace = Trace()
    q, v, a = ([trace.variable(2 * part + k) for k in range(2)] for part in range(3))
    outputs = [
        -sin(q[0]) * v[1] + 0.1 * v[0].direction(),
        abs(a[1] - 2.5) * (-q[1]).exp() - cos(q[0]) * -3.0,
        -0.25,
        v[0] - v[0],
        (-2.0 * v[1]).tanh(),
    ]
    lines = code_lines(trace, outputs, PYTHON, 2)
    assert inputs_of(trace, outputs, 2) == "qva"
    assert inputs_of(trace, outputs[2:4], 2) == ""
    names = {
        "sin": math.sin, "cos": math.cos, "exp": math.exp, "fabs": abs, "sign": np.sign, "tanh": math.tanh,
        "q": [0.3, -0.2], "v": [-1.5, 0.7], "a": [0.0, 1.0], "out": [0.0] * 5,
    }  # fmt: skip
    first = next(k for k, line in enumerate(lines) if line.startswith("out"))
    assert all(line.startswith("out") for line in lines[first:])
    exec("\n".join(lines), names)
    expected = [-math.sin(0.3) * 0.7 - 0.1, 1.5 * math.exp(0.2) + 3.0 * math.cos(0.3), -0.25, 0.0, -math.tanh(1.4)]
    np.testing.assert_allclose(names["out"], expected, rtol=1e-15)


def test_what_is_written_is_python_that_gives_the_same_numbers() -> None:
    trace = Trace()
    text = "\n".join(
        [
            docstring("A first line.", ['with """ in it', "and a \\ backslash"]),
            constants({"TABLE": (numbers(np.array([1 / 3, 1e-300])), "a comment"), "NAMES": (("a", "b'"), "names")}),
            function("twice", "Doubled.", trace, [2.0 * trace.variable(1), 0.5], 1),
        ]
    )
    found: dict = {}
    exec(text, found)
    assert found["TABLE"] == (1 / 3, 1e-300)
    assert found["NAMES"] == ("a", "b'")
    assert found["twice"]([0.0], [3.0], [0.0]) == [6.0, 0.5]
    assert found["__doc__"].startswith("A first line.")
