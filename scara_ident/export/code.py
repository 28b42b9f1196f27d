"""Recorded arithmetic as straight-line code of a programming language, and the parts of the Python modules that have it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from scara_ident.model.regressor import tracing as op
from scara_ident.model.regressor.tracing import Expr, Scalar, Trace, needed


@dataclass(frozen=True)
class Language:
    """How a language writes things.

    Attributes
    ----------
    statement : str
        An intermediate result, of ``{name}`` and ``{value}``.
    output : str
        Element ``{place}`` of ``out``, of ``{value}``.
    functions : mapping of int to str
        Sine, cosine, size, sign, exponential and hyperbolic tangent, of ``{x}``.
    number : callable
        Writes a number so that it reads back the same.
    """

    statement: str
    output: str
    functions: dict[int, str]
    number: Callable[[float], str]


PYTHON = Language(
    "{name} = {value}",
    "out[{place}] = {value}",
    {
        op.SIN: "sin({x})",
        op.COS: "cos({x})",
        op.ABS: "fabs({x})",
        op.SIGN: "sign({x})",
        op.EXP: "exp({x})",
        op.TANH: "tanh({x})",
    },
    repr,
)
"""Python, with numbers or whatever else its functions take."""


def code_lines(trace: Trace, outputs: Sequence[Scalar], language: Language, joints: int) -> list[str]:
    """Write what outputs need, then the outputs, so that they may stand where inputs did.

    Parameters
    ----------
    trace : Trace
        Inputs are q, v and a of ``joints`` joints, one after the other.
    outputs : sequence of Expr or float
        Elements of ``out``.
    """
    names: dict[int, str] = {}
    lines: list[str] = []
    for node in needed(trace, outputs):
        operation, first, second = trace.nodes[node]
        if operation == op.VAR:
            names[node] = f"{'qva'[first // joints]}[{first % joints}]"
            continue
        x = names[first]
        if operation in (op.ADD, op.SUB, op.MUL):
            value = f"{x} {'+-*'[(op.ADD, op.SUB, op.MUL).index(operation)]} {names[second]}"
        elif operation in (op.ADD_CONST, op.MUL_CONST):
            value = f"{x} {'+' if operation == op.ADD_CONST else '*'} {_constant(second, language)}"
        else:
            value = language.functions[operation].replace("{x}", f"-{x}" if operation == op.EXP and second < 0 else x)
        names[node] = f"t{len(lines)}"
        lines.append(language.statement.replace("{name}", names[node]).replace("{value}", value))
    for place, output in enumerate(outputs):
        value = _output(output, names, language)
        lines.append(language.output.replace("{place}", str(place)).replace("{value}", value))
    return lines


def inputs_of(trace: Trace, outputs: Iterable[Scalar], joints: int) -> str:
    """Return which of the letters q, v and a outputs depend on."""
    found = {trace.nodes[node][1] // joints for node in needed(trace, outputs) if trace.nodes[node][0] == op.VAR}
    return "".join("qva"[k] for k in sorted(found))


def _output(value: Scalar, names: dict[int, str], language: Language) -> str:
    if isinstance(value, Expr):
        return names[value.node] if value.sign > 0 else f"-{names[value.node]}"
    return _constant(value, language)


def _constant(value: float, language: Language) -> str:
    text = language.number(float(value))
    return f"({text})" if text.startswith("-") else text


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
