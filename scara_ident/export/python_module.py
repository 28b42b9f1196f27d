"""The parts of Python modules that exports write: tables of numbers, and torques as functions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from scara_ident.export.code import PYTHON, code_lines
from scara_ident.model.regressor.tracing import Scalar, Trace


def docstring(first: str, lines: Sequence[str]) -> str:
    """Return a module's docstring."""
    text = "\n".join([first, "", *lines]) if lines else first
    return '"""' + text.replace("\\", "/").replace('"""', "'''") + ('\n"""' if lines else '"""')


def constants(values: Mapping[str, tuple[Any, str]]) -> str:
    """Return assignments with their comments."""
    return "\n".join(f"{name} = {value!r}  # {comment}" for name, (value, comment) in values.items())


def numbers(values: Any) -> tuple[float, ...]:
    """Return an array's numbers as they are written."""
    return tuple(float(value) for value in values)


def function(name: str, about: str, trace: Trace, outputs: Sequence[Scalar], joints: int) -> str:
    """Return a function of q, v and a that gives a list."""
    lines = [
        f'"""{about}"""',
        f"out = [0.0] * {len(outputs)}",
        *code_lines(trace, outputs, PYTHON, joints),
        "return out",
    ]
    return "\n    ".join([f"def {name}(q, v, a):", *lines])
