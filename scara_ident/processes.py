"""Independent work on all cores, in one order whatever the number of processes."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TypeVar

from scara_ident.threads import forget_threads, one_blas_thread, one_thread, works_alone

Item = TypeVar("Item")
Result = TypeVar("Result")

_work: Callable[[Any], Any] | None = None
# Threads begin without it.
_OWN: ContextVar[bool] = ContextVar("own process", default=False)


def available_cores() -> int:
    """Number of cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def map_in_order(
    work: Callable[[Item], Result], items: Iterable[Item], processes: int | None = None
) -> Iterator[Result]:
    """Apply a function to items, several at a time, and give the results in the order of the items.

    Workers are forked, so that the function may hold what cannot be sent to another process; where the system cannot
    fork, the items are worked on one after the other. Each worker has one BLAS thread.

    Parameters
    ----------
    work : callable
    items : iterable
        Sent to the workers, as are the results to the caller.
    processes : int, optional
        Default: as many as there are cores.
    """
    wanted = list(items)
    count = min(available_cores() if processes is None else processes, len(wanted))
    if count <= 1 or not _may_fork():
        with one_blas_thread():
            yield from map(work, wanted)
        return
    with _forked(count, work) as pool:
        yield from pool.map(_apply, wanted)


def all_beside(tasks: Sequence[Callable[[], None]]) -> None:
    """Do tasks that leave files behind, several at a time, see `map_in_order`."""
    for _ in map_in_order(lambda place: tasks[place](), range(len(tasks))):
        pass


@contextmanager
def beside(work: Callable[[], Result]) -> Iterator[Callable[[], Result]]:
    """Do work in another process meanwhile, whose memory goes with it; yields what waits for the result.

    Where the system cannot fork, the work is done when it is waited for.

    Parameters
    ----------
    work : callable
        Its result is sent to the caller, as is its error.
    """
    if not _may_fork():
        yield work
        return

    def alone(_: None) -> Result:
        forget_threads()
        return work()

    with _forked(1, alone) as pool:
        yield pool.submit(_apply, None).result


@contextmanager
def own_process() -> Iterator[None]:
    """Let `halved` use another process: nobody else's threads run in this one, whose locks a fork would never see released.

    A command says so of its own; in a program or a notebook of others nothing is forked unasked.
    """
    token = _OWN.set(True)
    try:
        yield
    finally:
        _OWN.reset(token)


def halved(work: Callable[[Item], Result], items: Sequence[Item], sizes: Sequence[float]) -> list[Result]:
    """Apply a function to items, about half of them in another process, and return the results in their order.

    For work of many short steps, for which two threads only wait for each other. It is all done here where only one core may
    be used, the caller is one of several that work side by side, or is not known to be alone in its process, see `own_process`.

    Parameters
    ----------
    work : callable
        What it keeps of the other half is lost with that process.
    items : sequence
    sizes : sequence of float
        How long each takes, relative to each other.
    """
    own, other = set[int](), set[int]()
    for place in sorted(range(len(items)), key=lambda place: -sizes[place]):
        least = min((own, other), key=lambda half: sum(sizes[k] for k in half))
        least.add(place)
    if not other or works_alone() or available_cores() == 1 or not _OWN.get() or not _may_fork():
        return [work(item) for item in items]
    with one_thread(), beside(lambda: [work(items[place]) for place in sorted(other)]) as told:
        found = {place: work(items[place]) for place in sorted(own)}
        found |= zip(sorted(other), told(), strict=True)
    return [found[place] for place in range(len(items))]


def _may_fork() -> bool:
    """Whether the system can fork, and this is not the worker of a pool that must have no processes of its own."""
    return "fork" in multiprocessing.get_all_start_methods() and not multiprocessing.current_process().daemon


@contextmanager
def _forked(count: int, work: Callable[[Any], Any]) -> Iterator[ProcessPoolExecutor]:
    context = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(count, mp_context=context, initializer=_adopt, initargs=(work,)) as pool:
        try:
            yield pool
        except BaseException:
            # Leaving the pool waits for its work, which nobody wants any more.
            pool.shutdown(wait=False, cancel_futures=True)
            for worker in multiprocessing.active_children():
                worker.kill()
            raise


def _adopt(work: Callable[[Any], Any]) -> None:
    global _work
    _work = work


def _apply(item: Any) -> Any:
    if _work is None:
        raise RuntimeError("the worker was not given its function")
    with one_blas_thread():
        return _work(item)
