"""Independent work on all cores, in one order whatever the number of processes."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from typing import Any, TypeVar

from scara_ident.threads import forget_threads, one_blas_thread

Item = TypeVar("Item")
Result = TypeVar("Result")

_work: Callable[[Any], Any] | None = None


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
    if count <= 1 or "fork" not in multiprocessing.get_all_start_methods():
        with one_blas_thread():
            yield from map(work, wanted)
        return
    with _forked(count, work) as pool:
        yield from pool.map(_apply, wanted)


@contextmanager
def beside(work: Callable[[], Result]) -> Iterator[Callable[[], Result]]:
    """Do work in another process meanwhile, whose memory goes with it; yields what waits for the result.

    Where the system cannot fork, the work is done when it is waited for.

    Parameters
    ----------
    work : callable
        Its result is sent to the caller, as is its error.
    """
    if "fork" not in multiprocessing.get_all_start_methods():
        yield work
        return

    def alone(_: None) -> Result:
        forget_threads()
        return work()

    with _forked(1, alone) as pool:
        yield pool.submit(_apply, None).result


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
