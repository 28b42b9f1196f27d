"""Two threads over recordings or joints, and one BLAS thread where matrices are small."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import cache
from typing import Any, TypeVar

from threadpoolctl import ThreadpoolController

T = TypeVar("T")
# Loops of NumPy hold the interpreter's lock between their calls, so that more than two threads wait for each other.
THREADS = 2


@cache
def _controller() -> ThreadpoolController:
    return ThreadpoolController()


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Hold BLAS to one thread: on the small panels of a factor, two take seven times as long as one."""
    with _controller().limit(limits=1, user_api="blas"):
        yield


def side_by_side(function: Callable[..., T], *items: Iterable[Any]) -> list[T]:
    """Apply a function to items in two threads with one BLAS thread each, and return the results in order."""
    with one_blas_thread(), ThreadPoolExecutor(max_workers=THREADS) as pool:
        return list(pool.map(function, *items))
