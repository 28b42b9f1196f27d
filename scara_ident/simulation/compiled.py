"""The one way in which this package compiles its loops."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, ParamSpec, TypeVar, cast

from numba import njit

P = ParamSpec("P")
R = TypeVar("R")

# A division by zero is infinite, as NumPy's; the caller of the arrays holds them.
# The interpreter is free meanwhile, so that two arms move side by side.
OPTIONS = {"error_model": "numpy", "_nrt": False, "nogil": True}
# Of functions that Python never calls.
NO_DOORS = {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
SOURCES = ("compiled.py", "spatial.py", "plant.py", "external.py", "forces.py", "integrate.py", "loop.py")


def compiled(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function with numba; the machine code is kept on disk, so that only the first run waits for it.

    It may neither make nor return arrays: references to them are not counted, which for all those of a plant took three
    quarters of the loop's time, at every call within it.

    Numba keeps the code of a function as long as its own file does not change, also when a function that it calls
    has changed in another file. So the stamp of its file is replaced by one of all the sources.
    """
    return _compiled(function, OPTIONS)


def compiled_within(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function that compiled ones call, and Python never: without a door for it the first run is a third shorter."""
    return _compiled(function, {**OPTIONS, **NO_DOORS})


def compiled_in_place(function: Callable[P, R]) -> Callable[P, R]:
    """Compile a function into each that calls it.

    A call hands over some hundred numbers that tell where the arrays of a plant lie, which took as long as what was done
    with them. What is called from few places and calls on is compiled so; of the rest it would only make compiling longer.
    """
    return _compiled(function, {**OPTIONS, **NO_DOORS, "forceinline": True})


def _compiled(function: Callable[P, R], options: Mapping[str, Any]) -> Callable[P, R]:
    dispatcher = njit(cache=True, **options)(function)
    kept = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    if kept is not None and hasattr(kept, "_source_stamp"):
        kept._source_stamp = _stamp()
    else:
        # Another numba: better compile in every run than run what was compiled from older sources.
        dispatcher = njit(**options)(function)
    return cast(Callable[P, R], dispatcher)


def at_hand(function: Callable[..., object]) -> bool:
    """Return whether a compiled function runs at once: it ran in this process, or its machine code is on disk."""
    if getattr(function, "overloads", None) != {}:
        return True
    kept = getattr(getattr(function, "_cache", None), "_cache_file", None)
    return kept is not None and hasattr(kept, "_load_index") and bool(kept._load_index())


@cache
def _stamp() -> str:
    digest = hashlib.sha256()
    for name in SOURCES:
        digest.update((Path(__file__).parent / name).read_bytes())
    return digest.hexdigest()
