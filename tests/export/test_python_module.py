from __future__ import annotations

import numpy as np

from scara_ident.export.python_module import constants, docstring, function, numbers
from scara_ident.model.regressor.tracing import Trace


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
