"""Exact derivatives of recorded arithmetic, recorded in their turn."""

from __future__ import annotations

from collections.abc import Sequence

from scara_ident.model.regressor.tracing import (
    ABS,
    ADD,
    ADD_CONST,
    COS,
    EXP,
    MUL,
    MUL_CONST,
    SIGN,
    SIN,
    SUB,
    Expr,
    Scalar,
    needed,
)


def derivative(values: Sequence[Scalar], variable: Expr) -> list[Scalar]:
    """Differentiate expressions by an input, forwards through the graph (Griewank, Walther 2008, chapter 3).

    Parameters
    ----------
    values : sequence of Expr or float
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
        if operation == ADD:
            found = along + slopes.get(second, 0.0)
        elif operation == SUB:
            found = along - slopes.get(second, 0.0)
        elif operation == MUL:
            found = Expr(trace, second, 1) * along + x * slopes.get(second, 0.0)
        elif operation == ADD_CONST:
            found = along
        elif operation == MUL_CONST:
            found = along * second
        elif operation == SIN:
            found = x.cos() * along
        elif operation == COS:
            found = -x.sin() * along
        elif operation == ABS:
            found = x.direction() * along
        elif operation == EXP:
            found = Expr(trace, node, second) * along
        if operation != SIGN and not (isinstance(found, float) and found == 0.0):
            slopes.setdefault(node, found)
    return [slopes.get(value.node, 0.0) * value.sign if isinstance(value, Expr) else 0.0 for value in values]
