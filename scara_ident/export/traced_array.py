"""Arrays of recorded expressions, so that code written for arrays of numbers records what it does."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from scara_ident.model.regressor.tracing import Expr, Scalar


# For the type checker an array of numbers, in whose place it stands.
class TracedArray(np.ndarray[Any, np.dtype[np.float64]]):
    """An array of expressions and numbers that also knows the functions which numpy has for numbers only."""

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, out: Any = None, **more: Any) -> Any:
        """Evaluate a function element by element."""
        plain = [np.asarray(item) if isinstance(item, np.ndarray) else item for item in inputs]
        targets = None if out is None else tuple(np.asarray(item) for item in out)
        own = _FUNCTIONS.get(ufunc) if method == "__call__" else None
        if own is None:
            result = getattr(ufunc, method)(*plain, **(more if targets is None else {**more, "out": targets}))
        else:
            result = np.frompyfunc(own, ufunc.nin, 1)(*plain)
            if targets is not None:
                np.copyto(targets[0], result)
        if out is not None:
            return out[0]
        return traced(result) if isinstance(result, np.ndarray) and result.dtype.hasobject else result


def traced(values: Iterable[Any]) -> TracedArray:
    """Return expressions and numbers, or an array of them, as an array that records."""
    found: TracedArray = np.asarray(values, dtype=object).view(TracedArray)
    return found


def _sign(value: Scalar) -> Scalar:
    return value.direction() if isinstance(value, Expr) else float(np.sign(value))


def _below(value: Scalar, bound: float) -> bool:
    """Whether a value lies below a bound; an expression is only known to lie below what is infinite."""
    if isinstance(value, Expr) and bound != np.inf:
        raise TypeError("whether an expression is below a finite number is not known while it is recorded")
    return not bool(isinstance(value, float) and value >= bound)


def _of(function: np.ufunc, name: str) -> Callable[[Scalar], Scalar]:
    def evaluate(value: Scalar) -> Scalar:
        return getattr(value, name)() if isinstance(value, Expr) else float(function(value))

    return evaluate


_FUNCTIONS: dict[np.ufunc, Callable[..., Any]] = {
    np.sign: _sign,
    np.absolute: lambda value: abs(value),
    np.sin: _of(np.sin, "sin"),
    np.cos: _of(np.cos, "cos"),
    np.exp: _of(np.exp, "exp"),
    np.less: _below,
    np.square: lambda value: value * value,
    np.power: lambda value, power: value**power,
}
