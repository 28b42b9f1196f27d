"""Straight-line code made of a trace."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np

from scara_ident.arrays import Array


@dataclass(frozen=True, eq=False)
class Program:
    """Straight-line code that evaluates traced expressions over vectors of samples.

    ``evaluate(inputs, outputs, buffers)``: rows are vectors over the samples, or one number for all of them. It writes
    row k of `outputs` for every target k that the program was made for, and uses `buffers` as scratch space.

    Attributes
    ----------
    buffers : int
        Number of scratch vectors that it needs.
    operations : int
        Number of vector operations.
    source : str
        The code itself.
    constants : mapping of str to float
        Numbers that it names.
    """

    buffers: int
    operations: int
    source: str
    constants: Mapping[str, float]

    @cached_property
    def evaluate(self) -> Callable[[Sequence[Array] | Array, Any, Array], None]:
        """The code, compiled when it is first asked for."""
        namespace: dict[str, Any] = {
            "add": np.add,
            "sub": np.subtract,
            "mul": np.multiply,
            "neg": np.negative,
            "sin": np.sin,
            "cos": np.cos,
            "absolute": np.absolute,
            "sign": np.sign,
            "exp": np.exp,
            "tanh": np.tanh,
            "copy": np.copyto,
        }
        # As arrays without dimension: a Python float would be converted in every operation.
        namespace.update({name: np.array(value) for name, value in self.constants.items()})
        exec(compile(self.source, "<traced program>", "exec"), namespace)
        return cast(Callable[[Sequence[Array] | Array, Any, Array], None], namespace["evaluate"])

    def __getstate__(self) -> dict[str, Any]:
        """Leave the compiled code out of a copy: it cannot be sent."""
        return {name: value for name, value in vars(self).items() if name != "evaluate"}
