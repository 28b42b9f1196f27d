"""Arithmetic recorded once and emitted as straight-line numpy code.

A computation written with `Expr` in place of numbers leaves a graph of elementary operations in its `Trace`.
Numbers stay plain floats, so zeros, ones and every constant sub-expression fold away while tracing; equal
operations share one node, and signs are kept beside the nodes, so that ``a - b`` and ``b - a`` share one too.
`compile_program` turns the part of the graph that the outputs need into one Python function of vector operations.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.model.regressor.program import Program

VAR, SIN, COS, ADD, SUB, MUL, ADD_CONST, MUL_CONST, SIGN, ABS, EXP, TANH = range(12)

_BINARY = (ADD, SUB, MUL)
"""Operations on two nodes."""
_CANCELLED = 1e-13
"""A sum this small, relative to its terms, is rounding."""


class Trace:
    """The graph of one traced computation.

    Attributes
    ----------
    nodes : list of tuple
        ``(operation, first operand, second operand)``; operands are indices of earlier nodes, the second one is a
        float for operations with a constant, and for EXP the sign of its operand. A variable's first operand is its index among the inputs.
    """

    def __init__(self) -> None:
        self.nodes: list[tuple[int, int, Any]] = []
        self._index: dict[tuple[int, int, Any], int] = {}

    def variable(self, index: int) -> Expr:
        """Return input number `index`."""
        return Expr(self, self.node(VAR, index, 0), 1)

    def node(self, operation: int, first: int, second: Any) -> int:
        """Return the index of an operation, which is recorded unless it is already there."""
        key = (operation, first, second)
        found = self._index.get(key)
        if found is None:
            found = self._index[key] = len(self.nodes)
            self.nodes.append(key)
        return found


class Expr:
    """A signed node of a trace; the arithmetic operators record what is done with it."""

    __slots__ = ("node", "sign", "trace")

    def __init__(self, trace: Trace, node: int, sign: int) -> None:
        self.trace, self.node, self.sign = trace, node, sign

    def __neg__(self) -> Expr:
        return Expr(self.trace, self.node, -self.sign)

    def __add__(self, other: Scalar) -> Scalar:
        if isinstance(other, Expr):
            return self._sum(other, other.sign)
        if other == 0.0:
            return self
        operation, first, second = self.trace.nodes[self.node]
        constant: float = self.sign * other
        if operation != ADD_CONST:
            return Expr(self.trace, self.trace.node(ADD_CONST, self.node, constant), self.sign)
        total: float = self.sign * (second + constant)
        return Expr(self.trace, first, self.sign) + total

    __radd__ = __add__

    def __sub__(self, other: Scalar) -> Scalar:
        return self._sum(other, -other.sign) if isinstance(other, Expr) else self + (-other)

    def __rsub__(self, other: float) -> Scalar:
        return -self + other

    def _sum(self, other: Expr, other_sign: int) -> Scalar:
        x, y = self.node, other.node
        if x == y:
            return 2.0 * self if self.sign == other_sign else 0.0
        trace, sign = self.trace, self.sign
        if sign == other_sign:
            return Expr(trace, trace.node(ADD, min(x, y), max(x, y)), sign)
        if x > y:
            x, y, sign = y, x, -sign
        return Expr(trace, trace.node(SUB, x, y), sign)

    def __mul__(self, other: Scalar) -> Scalar:
        trace = self.trace
        if isinstance(other, Expr):
            x, y = self.node, other.node
            return Expr(trace, trace.node(MUL, min(x, y), max(x, y)), self.sign * other.sign)
        if other == 0.0:
            return 0.0
        sign = self.sign if other > 0 else -self.sign
        if abs(other) == 1.0:
            return Expr(trace, self.node, sign)
        operation, first, second = trace.nodes[self.node]
        if operation == MUL_CONST:
            factor: float = second * abs(other)
            return Expr(trace, first, sign) * factor
        return Expr(trace, trace.node(MUL_CONST, self.node, abs(other)), sign)

    __rmul__ = __mul__

    def __truediv__(self, other: float) -> Scalar:
        return self * (1.0 / other)

    def __pow__(self, power: int) -> Scalar:
        result: Scalar = 1.0
        for _ in range(int(power)):
            result = self * result
        return result

    def __abs__(self) -> Expr:
        return Expr(self.trace, self.trace.node(ABS, self.node, 0), 1)

    # Under these names numpy looks for them in arrays of objects.
    def sin(self) -> Expr:
        """Return the sine."""
        return Expr(self.trace, self.trace.node(SIN, self.node, 0), self.sign)

    def cos(self) -> Expr:
        """Return the cosine."""
        return Expr(self.trace, self.trace.node(COS, self.node, 0), 1)

    def exp(self) -> Expr:
        """Return the exponential."""
        return Expr(self.trace, self.trace.node(EXP, self.node, self.sign), 1)

    def tanh(self) -> Expr:
        """Return the hyperbolic tangent."""
        return Expr(self.trace, self.trace.node(TANH, self.node, 0), self.sign)

    def direction(self) -> Expr:
        """Return -1, 0 or 1, the sign that the value will have."""
        return Expr(self.trace, self.trace.node(SIGN, self.node, 0), self.sign)


Scalar = Expr | float
"""What a traced computation handles: a recorded expression or a number known while tracing."""


def sin(angle: Scalar) -> Scalar:
    """Sine of an expression or of a number."""
    return angle.sin() if isinstance(angle, Expr) else float(np.sin(angle))


def cos(angle: Scalar) -> Scalar:
    """Cosine of an expression or of a number."""
    return angle.cos() if isinstance(angle, Expr) else float(np.cos(angle))


def operands(trace: Trace, node: int) -> tuple[int, ...]:
    """Return the nodes that an operation is done with."""
    operation, first, second = trace.nodes[node]
    if operation == VAR:
        return ()
    return (first, second) if operation in _BINARY else (first,)


def needed(trace: Trace, values: Iterable[Scalar]) -> list[int]:
    """Return the nodes that values need, each just before what first needs it."""
    order: list[int] = []
    done: set[int] = set()
    for value in values:
        stack = [value.node] if isinstance(value, Expr) else []
        while stack:
            node = stack[-1]
            waiting = [x for x in operands(trace, node) if x not in done]
            if node in done or not waiting:
                stack.pop()
                if node not in done:
                    done.add(node)
                    order.append(node)
            else:
                stack.extend(reversed(waiting))
    return order


def vanishing(trace: Trace, values: Sequence[Scalar], inputs: Array) -> list[bool]:
    """Tell which values are zero at all states although their expressions are not.

    Tracing does not know that cos^2 + sin^2 = 1. A sum that cancels at every one of a few random states, down to
    the rounding of its terms, cancels always: analytic functions that are not zero are zero almost nowhere. The
    sizes of terms add as independent roundings do, in squares: a turn then leaves the size of a vector as it is.
    Added as they are, they would grow by sqrt(3) with every joint, and hide what a chain of sixteen tells.

    Parameters
    ----------
    inputs : ndarray (inputs, states)
        Random states.
    """
    found: list[Array] = []
    sizes: list[Array] = []
    for operation, first, second in trace.nodes:
        if operation == VAR:
            value = inputs[first]
            size = np.abs(value)
        elif operation in (SIN, COS):
            value = np.sin(found[first]) if operation == SIN else np.cos(found[first])
            size = np.abs(value)
        else:
            x, size_x = found[first], sizes[first]
            y, size_y = (found[second], sizes[second]) if operation in _BINARY else (second, abs(second))
            if operation in (MUL, MUL_CONST):
                value, size = x * y, size_x * size_y
            else:
                value, size = (x - y if operation == SUB else x + y), np.hypot(size_x, size_y)
        found.append(value)
        sizes.append(size)
    return [
        bool(np.all(np.abs(found[value.node]) <= _CANCELLED * sizes[value.node]))
        if isinstance(value, Expr)
        else value == 0.0
        for value in values
    ]


def compile_program(trace: Trace, outputs: Sequence[tuple[int, Scalar]]) -> Program:
    """Emit the code of all `outputs` and nothing that they do not need.

    Parameters
    ----------
    trace : Trace
        The graph in which the expressions were recorded.
    outputs : sequence of (int, Expr or float)
        Index of each target vector and what to write there, in the order of evaluation.
    """
    return _Emitter(trace, outputs).program()


class _Emitter:
    """One run of the emission: order of evaluation, stored signs, vectors reused after their last use."""

    def __init__(self, trace: Trace, outputs: Sequence[tuple[int, Scalar]]) -> None:
        self.trace, self.nodes = trace, trace.nodes
        self.outputs = outputs
        self.targets: dict[int, list[tuple[int, int]]] = {}
        for target, value in outputs:
            if isinstance(value, Expr):
                self.targets.setdefault(value.node, []).append((target, value.sign))
        self.order = needed(trace, (value for _, value in outputs))
        self.wish = self._wishes()
        self.stored: dict[int, int] = {}
        self.place: dict[int, str] = {}
        self.constants: dict[float, str] = {}
        self.lines: list[str] = []
        self.free: list[str] = []
        self.buffers = 0

    def _wishes(self) -> dict[int, int]:
        """Choose the sign with which each node is best stored, so that hardly any negation is left.

        Sums and products with a constant come in either sign for free, a product of two nodes when one of them
        does; so the sign that an output asks for is handed down until it costs nothing.
        """
        wish = {node: targets[0][1] for node, targets in self.targets.items()}
        for node in reversed(self.order):
            operation, first, second = self.nodes[node]
            if wish.get(node, 1) > 0:
                continue
            if operation in (ADD, MUL):
                for operand in (second, first):
                    if operand not in wish and self.nodes[operand][0] not in (VAR, SIN, COS):
                        wish[operand] = -1
                        break
            elif operation in (SIN, TANH) and first not in wish:
                wish[first] = -1
        return wish

    def _constant(self, value: float) -> str:
        return self.constants.setdefault(value, f"k{len(self.constants)}")

    def _destination(self, node: int) -> str:
        if node in self.targets:
            return f"o{self.targets[node][0][0]}"
        if not self.free:
            self.free.append(f"b{self.buffers}")
            self.buffers += 1
        return self.free.pop()

    def _statement(self, node: int, sign: int) -> tuple[str, int]:
        """Return the operation of `node` and the sign of its result, which is `sign` where that is free."""
        operation, first, second = self.nodes[node]
        x, sign_x = self.place[first], self.stored[first]
        if operation in (SIN, TANH):
            return f"{'sin' if operation == SIN else 'tanh'}({x}", sign_x
        if operation in (COS, ABS):
            return f"{'cos' if operation == COS else 'absolute'}({x}", 1
        if operation == SIGN:
            return f"sign({x}", sign_x
        if operation == EXP:
            return (f"exp({x}" if sign_x == second else f"exp(neg({x})"), 1
        if operation == MUL_CONST:
            return f"mul({x}, {self._constant(sign * sign_x * second)}", sign
        if operation == ADD_CONST:
            constant = self._constant(sign * second)
            return (f"add({x}, {constant}" if sign == sign_x else f"sub({constant}, {x}"), sign
        y, sign_y = self.place[second], self.stored[second]
        if operation == MUL:
            return f"mul({x}, {y}", sign_x * sign_y
        sign_y = sign_y if operation == ADD else -sign_y
        if sign_x == sign_y:
            return f"add({x}, {y}", sign_x
        return (f"sub({x}, {y}" if sign_x == sign else f"sub({y}, {x}"), sign

    def program(self) -> Program:
        """Emit and compile."""
        last_use: dict[int, int] = {}
        for step, node in enumerate(self.order):
            for operand in operands(self.trace, node):
                last_use[operand] = step
        for step, node in enumerate(self.order):
            if self.nodes[node][0] == VAR:
                self.place[node], self.stored[node] = f"x{self.nodes[node][1]}", 1
            else:
                statement, self.stored[node] = self._statement(node, self.wish.get(node, 1))
                for operand in set(operands(self.trace, node)):
                    # Freed before the result is placed: an operation may write over its own operand.
                    if last_use[operand] == step and self.place[operand].startswith("b"):
                        self.free.append(self.place[operand])
                self.place[node] = self._destination(node)
                self.lines.append(f"{statement}, {self.place[node]})")
            self._write_targets(node)
        self.lines += [f"o{k}.fill({value!r})" for k, value in self.outputs if not isinstance(value, Expr)]
        return self._compile()

    def _write_targets(self, node: int) -> None:
        """Bring a finished node to the outputs that do not hold it yet, in the sign that they ask for."""
        place, stored = self.place[node], self.stored[node]
        for target, sign in reversed(self.targets.get(node, [])):
            name = f"o{target}"
            if sign != stored:
                self.lines.append(f"neg({place}, {name})")
                if place == name:
                    self.stored[node] = stored = sign
            elif place != name:
                self.lines.append(f"copy({name}, {place})")

    def _compile(self) -> Program:
        inputs = sorted(self.nodes[node][1] for node in self.order if self.nodes[node][0] == VAR)
        head = [f"x{k} = inputs[{k}]" for k in inputs]
        head += [f"o{k} = outputs[{k}]" for k, _ in self.outputs]
        head += [f"b{k} = buffers[{k}]" for k in range(self.buffers)]
        body = "\n    ".join([*head, *self.lines, "return"])
        source = f"def evaluate(inputs, outputs, buffers):\n    {body}\n"
        constants = {name: value for value, name in self.constants.items()}
        return Program(self.buffers, len(self.lines), source, constants)
