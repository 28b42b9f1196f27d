"""Straight-line code over vectors."""

from __future__ import annotations

import pickle

import numpy as np

from scara_ident.model.regressor.program import Program


def test_a_program_writes_its_outputs_also_from_a_copy() -> None:
    source = "def evaluate(inputs, outputs, buffers):\n    mul(inputs[0], c0, outputs[0])\n    sin(outputs[0], outputs[0])\n    return\n"
    program = Program(0, 2, source, {"c0": 2.0})
    x = np.linspace(-1.0, 1.0, 5)
    for made in (program, pickle.loads(pickle.dumps(program))):
        out = np.empty((1, 5))
        made.evaluate(x[None], out, np.empty((0, 5)))
        np.testing.assert_allclose(out[0], np.sin(2.0 * x))
