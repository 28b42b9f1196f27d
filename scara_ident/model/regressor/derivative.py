"""Exact derivatives of recorded arithmetic, recorded in their turn."""

from __future__ import annotations

from collections.abc import Sequence

from scara_ident.model.regressor import tracing as op
from scara_ident.model.regressor.tracing import Expr, Scalar, needed


def gradient(values: Sequence[Scalar], seeds: Sequence[Scalar], variables: Sequence[Expr]) -> list[Scalar]:
    """Differentiate ``sum_k seed_k value_k`` by inputs, backwards through the graph (Griewank, Walther 2008, chapter 3).

    All inputs cost together a few times what the values do.

    Parameters
    ----------
    seeds : sequence of Expr or float
        One per value, not differentiated.
    variables : sequence of Expr
        Inputs of the same trace.

    Returns
    -------
    list of Expr or float
        One per input.
    """
    slopes: dict[int, Scalar] = {}

    def add(node: int, slope: Scalar) -> None:
        slopes[node] = slopes.get(node, 0.0) + slope

    for value, seed in zip(values, seeds, strict=True):
        if isinstance(value, Expr):
            add(value.node, seed * value.sign)
    trace = variables[0].trace
    for node in reversed(needed(trace, values)):
        operation, first, second = trace.nodes[node]
        slope = slopes.get(node, 0.0)
        if operation in (op.VAR, op.SIGN) or (isinstance(slope, float) and slope == 0.0):
            continue
        x = Expr(trace, first, 1)
        if operation in (op.ADD, op.SUB):
            add(first, slope)
            add(second, slope if operation == op.ADD else -slope)
        elif operation == op.MUL:
            add(first, slope * Expr(trace, second, 1))
            add(second, slope * x)
        elif operation == op.ADD_CONST:
            add(first, slope)
        elif operation == op.MUL_CONST:
            add(first, slope * second)
        elif operation == op.SIN:
            add(first, slope * x.cos())
        elif operation == op.COS:
            add(first, -slope * x.sin())
        elif operation == op.ABS:
            add(first, slope * x.direction())
        elif operation == op.EXP:
            add(first, slope * Expr(trace, node, second))
        elif operation == op.TANH:
            add(first, slope * (1.0 - Expr(trace, node, 1) ** 2))
    return [slopes.get(variable.node, 0.0) * variable.sign for variable in variables]


def derivative(values: Sequence[Scalar], variable: Expr) -> list[Scalar]:
    """Differentiate expressions by an input, forwards through the graph (Griewank, Walther 2008, chapter 3).

    Parameters
    ----------
    variable : Expr
        An input of the same trace.

    Returns
    -------
    list of Expr or float
        One per value. The size of zero has the slope 0, and so has a sign everywhere.
    """
    trace = variable.trace
    slopes: dict[int, Scalar] = {variable.node: 1.0}
    for node in needed(trace, values):
        operation, first, second = trace.nodes[node]
        x, along = Expr(trace, first, 1), slopes.get(first, 0.0)
        found: Scalar = 0.0
        if operation == op.ADD:
            found = along + slopes.get(second, 0.0)
        elif operation == op.SUB:
            found = along - slopes.get(second, 0.0)
        elif operation == op.MUL:
            found = Expr(trace, second, 1) * along + x * slopes.get(second, 0.0)
        elif operation == op.ADD_CONST:
            found = along
        elif operation == op.MUL_CONST:
            found = along * second
        elif operation == op.SIN:
            found = x.cos() * along
        elif operation == op.COS:
            found = -x.sin() * along
        elif operation == op.ABS:
            found = x.direction() * along
        elif operation == op.EXP:
            found = Expr(trace, node, second) * along
        elif operation == op.TANH:
            found = (1.0 - Expr(trace, node, 1) ** 2) * along
        if operation != op.SIGN and not (isinstance(found, float) and found == 0.0):
            slopes.setdefault(node, found)
    return [slopes.get(value.node, 0.0) * value.sign if isinstance(value, Expr) else 0.0 for value in values]
