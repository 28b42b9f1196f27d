"""Two threads over recordings or joints, and one BLAS thread where matrices are small."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager, contextmanager, nullcontext
from functools import cache
from importlib import import_module
from typing import Any, Generic, TypeVar, overload

from threadpoolctl import ThreadpoolController

T = TypeVar("T")
# Loops of NumPy hold the interpreter's lock between their calls, so that more than two threads wait for each other.
THREADS = 2
# Samples of an array below which an operation on it takes no longer than to hand over that lock.
LONG_ARRAY = 10_000
# Seconds after which a thread that waits for the lock asks for it: in Python's 5 ms a recording is half done.
SOON = 2e-4
_LOCAL = threading.local()
_GUARD, _usual = threading.Lock(), list[float]()


class made_once(Generic[T]):
    """`functools.cached_property` without the lock that it has in Python 3.11.

    That lock is one for all instances, so that what two threads make for two recordings they make one after the other.
    """

    def __init__(self, function: Callable[[Any], T]) -> None:
        self.function = function
        self.__doc__ = function.__doc__

    @overload
    def __get__(self, instance: None, owner: type) -> made_once[T]: ...
    @overload
    def __get__(self, instance: object, owner: type) -> T: ...
    def __get__(self, instance: object | None, owner: type) -> made_once[T] | T:
        if instance is None:
            return self
        value = self.function(instance)
        instance.__dict__[self.function.__name__] = value
        return value


@cache
def _controller() -> ThreadpoolController:
    # NumPy and SciPy have a BLAS each; one that is loaded later would not be held, and has to begin with one thread.
    if os.environ.get("OPENBLAS_NUM_THREADS") != "1":
        import_module("scipy.linalg")
    return ThreadpoolController()


@cache
def _pool() -> ThreadPoolExecutor:
    """The threads beside the caller's, made once: to start one takes as long as to factor a small matrix."""

    def busy() -> None:
        _LOCAL.alone = _LOCAL.beside = True

    return ThreadPoolExecutor(max_workers=THREADS - 1, initializer=busy)


# A forked process does not have the threads of its parent: what they are given there waits for ever, and is kept.
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Hold BLAS to one thread: on the small panels of a factor, two take seven times as long as one."""
    if getattr(_LOCAL, "alone", False):
        yield
        return
    with _controller().limit(limits=1, user_api="blas"):
        _LOCAL.alone = True
        try:
            yield
        finally:
            _LOCAL.alone = False


@contextmanager
def _asked_soon() -> Iterator[None]:
    """Let threads wait for the interpreter's lock no longer than `SOON` before they ask for it, until the last caller is done."""
    with _GUARD:
        _usual.append(sys.getswitchinterval())
        sys.setswitchinterval(min(_usual[0], SOON))
    try:
        yield
    finally:
        with _GUARD:
            first = _usual[0]
            _usual.pop()
            if not _usual:
                sys.setswitchinterval(first)


@contextmanager
def one_thread() -> Iterator[None]:
    """Do one thing after the other on one BLAS thread, as in one of several processes that share the cores."""
    before = getattr(_LOCAL, "beside", False)
    with one_blas_thread():
        _LOCAL.beside = True
        try:
            yield
        finally:
            _LOCAL.beside = before


def available_cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def works_alone() -> bool:
    """Whether what is done now is to be done one thing after the other, since others work beside it."""
    return bool(getattr(_LOCAL, "beside", False))


def threads_for(samples: int) -> AbstractContextManager[None]:
    """Use both threads on arrays of so many samples where they are long, else one: two would wait for each other."""
    return nullcontext() if samples >= LONG_ARRAY else one_thread()


def side_by_side(function: Callable[..., T], *items: Iterable[Any]) -> list[T]:
    """Apply a function to items in two threads with one BLAS thread each, and return the results in order.

    What such a function wants side by side itself is done one after the other: both threads are at work.
    """
    work = list(zip(*items, strict=False))
    if len(work) < 2 or works_alone() or available_cores() < THREADS:
        with one_blas_thread():
            return [function(*arguments) for arguments in work]
    results: list[Any] = [None] * len(work)
    errors: dict[int, BaseException] = {}
    places = iter(range(len(work)))

    def take_turns() -> None:
        for place in places:
            try:
                results[place] = function(*work[place])
            except BaseException as error:
                errors[place] = error
            if errors:
                return

    with one_blas_thread(), _asked_soon():
        others = [_pool().submit(take_turns) for _ in range(THREADS - 1)]
        _LOCAL.beside = True
        take_turns()
        _LOCAL.beside = False
        for other in others:
            # One that has not begun, as it serves another caller, is not waited for.
            if not other.cancel():
                other.result()
    if errors:
        raise errors[min(errors)]
    return results
