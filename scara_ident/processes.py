"""Independent work on all cores, in one order whatever the number of processes."""

from __future__ import annotations

import multiprocessing
import pickle
import signal
import traceback
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import AbstractContextManager, contextmanager, suppress
from contextvars import ContextVar
from functools import cache, partial
from multiprocessing.connection import Connection, wait
from threading import Thread
from typing import Any, TypeVar

from scara_ident.errors import ProcessEnded
from scara_ident.threads import available_cores, one_blas_thread, one_thread, works_alone

Item = TypeVar("Item")
Result = TypeVar("Result")

# Items that a process is given ahead, so that it never waits for the caller.
AHEAD = 2
# Threads begin without it.
_OWN: ContextVar[bool] = ContextVar("own process", default=False)


def map_in_order(
    work: Callable[[Item], Result], items: Iterable[Item], processes: int | None = None
) -> Iterator[Result]:
    """Apply a function to items, several at a time, and give the results in the order of the items.

    Workers are forked, so that the function may hold what cannot be sent to another process; where the system cannot
    fork, the items are worked on one after the other. Each worker has one thread.

    Parameters
    ----------
    items : iterable
        The results are sent to the caller.
    processes : int, optional
        Default: as many as there are cores.
    """
    wanted = list(items)
    count = min(available_cores() if processes is None else processes, len(wanted))
    if count <= 1 or not _may_fork():
        with one_blas_thread():
            yield from map(work, wanted)
        return

    def beside_others(place: int) -> Result:
        with one_thread():
            return work(wanted[place])

    with _forked(count, beside_others) as workers:
        places, found = iter(range(len(wanted))), dict[int, tuple[bool, Any]]()
        given = {worker: list[int]() for worker in workers}
        # One to each before any has two: they may be as few as there are workers.
        for one in [*workers] * AHEAD:
            if (more := _give(one, places)) is not None:
                given[one].append(more)
        for place in range(len(wanted)):
            while place not in found:
                for worker in wait([worker for worker in workers if given[worker]]):
                    assert isinstance(worker, Connection)
                    found[given[worker].pop(0)] = _taken(worker)
                    if (more := _give(worker, places)) is not None:
                        given[worker].append(more)
            yield _result(*found.pop(place))


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

    with _forked(1, lambda _: work()) as (worker,):
        worker.send(0)
        taken = cache(lambda: _taken(worker))
        yield lambda: _result(*taken())


@contextmanager
def each_beside(
    work: Callable[[Item], Result], items: Sequence[Item]
) -> Iterator[Callable[[], list[Callable[[], Result]]]]:
    """Do work on items in another process meanwhile, one after the other; yields what waits for them all.

    That returns what gives each result, or raises its error. An item that ends its process gets another one, and where it ends that too
    its error is `ProcessEnded`; the others have theirs. Where the system cannot fork, or no command runs (see `own_process`), an item is
    worked on when it is asked for.

    Parameters
    ----------
    work : callable
        Its results are sent to the caller, as are its errors, each as soon as it is there.
    """
    if not items or not _OWN.get() or not _may_fork():
        yield lambda: [cache(partial(work, item)) for item in items]
        return

    def start() -> AbstractContextManager[list[Connection]]:
        return _forked(1, lambda place: work(items[place]))

    def taken(worker: Connection) -> Callable[[], Result]:
        # Of one at a time it is known which of them ended the process.
        worker.send(len(found))
        return partial(_result, *_taken(worker))

    found = list[Callable[[], Result]]()

    def ahead(worker: Connection) -> None:
        # The process may end, or be ended where nobody waits for it any more; what is too large for the memory ends here.
        with suppress(ProcessEnded, OSError, MemoryError):
            while len(found) < len(items):
                found.append(taken(worker))

    def ended() -> Result:
        raise _lost()

    def rest() -> list[Callable[[], Result]]:
        receiver.join()
        while len(found) < len(items):
            with start() as (another,):
                place = len(found)
                ahead(another)
                if len(found) == place:
                    found.append(ended)
        return found

    with start() as (worker,):
        receiver = Thread(target=ahead, args=(worker,), daemon=True)
        with uninterrupted():
            receiver.start()
        yield rest


@contextmanager
def own_process() -> Iterator[None]:
    """Let `halved` and `each_beside` use another process: nobody else's threads run in this one, whose locks a fork would never see released.

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
    sizes : sequence of float
        How long each takes, relative to each other.
    """
    own, other = set[int](), set[int]()
    for place in sorted(range(len(items)), key=lambda place: -sizes[place]):
        least = min((own, other), key=lambda half: sum(sizes[k] for k in half))
        least.add(place)
    if not other or works_alone() or available_cores() == 1 or not _OWN.get() or not _may_fork():
        return [work(item) for item in items]
    with one_thread(), beside(lambda: [work(items[place]) for place in sorted(other)]) as results:
        found = {place: work(items[place]) for place in sorted(own)}
        found |= zip(sorted(other), results(), strict=True)
    return [found[place] for place in range(len(items))]


def _may_fork() -> bool:
    """Whether the system can fork, and this is not the worker of a pool that must have no processes of its own."""
    return "fork" in multiprocessing.get_all_start_methods() and not multiprocessing.current_process().daemon


@contextmanager
def _forked(count: int, work: Callable[[int], Any]) -> Iterator[list[Connection]]:
    """Start processes that do work of a number; yields what the numbers are sent through and the results come back by.

    However the block ends, the processes are ended with it: nobody wants what they are still at.
    """
    context = multiprocessing.get_context("fork")
    processes, ends = [], list[Connection]()
    try:
        with uninterrupted():
            for _ in range(count):
                end, other = context.Pipe()
                ends.append(end)
                process = context.Process(target=_serve, args=(work, other, list(ends)))
                process.start()
                processes.append(process)
                other.close()
        yield ends
    finally:
        with uninterrupted():
            for process in processes:
                process.kill()
                process.join()
            for end in ends:
                end.close()


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Hold Ctrl-C back until the block ends; threads and processes that it starts never hear of one."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _serve(work: Callable[[int], Any], end: Connection, others: Sequence[Connection]) -> None:
    """Do work of the numbers that come, until the caller is gone."""
    # The caller ends this process; a signal to all of the terminal's is for the caller alone.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    for other in others:
        other.close()
    try:
        while True:
            end.send_bytes(_answer(work, end.recv()))
    except (EOFError, ConnectionError):
        return


def _answer(work: Callable[[int], Any], place: int) -> bytes:
    """Return whether work was done, and its result or its error, to be sent."""
    try:
        with one_blas_thread():
            return pickle.dumps((True, work(place)), pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        error.add_note(f"In another process:\n{traceback.format_exc()}")
        try:
            return pickle.dumps((False, error))
        except (TypeError, AttributeError, pickle.PicklingError):
            return pickle.dumps((False, RuntimeError(f"{type(error).__name__}: {error}")))


def _give(worker: Connection, places: Iterator[int]) -> int | None:
    """Send the next number to a process; return it, or None where none is left."""
    place = next(places, None)
    if place is not None:
        try:
            worker.send(place)
        except ConnectionError:
            raise _lost() from None
    return place


def _taken(worker: Connection) -> tuple[bool, Any]:
    try:
        done, found = pickle.loads(worker.recv_bytes())
    except (EOFError, ConnectionError):
        raise _lost() from None
    return done, found


def _lost() -> ProcessEnded:
    return ProcessEnded(
        "a process of this run was ended from outside, for example because memory ran out; give fewer or shorter recordings at a time"
    )


def _result(done: bool, found: Any) -> Any:
    if done:
        return found
    raise found
