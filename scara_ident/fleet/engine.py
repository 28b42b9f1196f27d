"""Work on many processes, of this machine or of a cluster, by Dask: what fails or dies takes nothing else with it."""

from __future__ import annotations

import logging
import os
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field
from functools import partial
from multiprocessing import resource_tracker
from queue import Empty, Queue
from typing import TYPE_CHECKING, Any, TypeVar

from scara_ident.errors import ProcessEnded, ScaraIdentError, UsageError
from scara_ident.fleet.folder import INSTALL
from scara_ident.processes import uninterrupted
from scara_ident.threads import available_cores

if TYPE_CHECKING:
    from distributed import Client, Future

Result = TypeVar("Result")
# A cluster that has had no worker for so long gets none any more, s; how often that is looked at.
NO_WORKER_SECONDS = 60.0
LOOK_SECONDS = 2.0
# A piece of work that so many workers and one more died on is given up.
MAX_DEATHS = 3
CONNECT_SECONDS = "10s"
# Variables that Dask gives processes beside those of its configuration.
DASK_VARIABLES = ("PYTHONHASHSEED", "__DASK_PARENT_PID")
# Bytes up to which a worker of this machine holds the memory of an array for the next one, and of all of them together.
KEPT_ARRAY, KEPT_MEMORY = 32 << 20, 128 << 20


@dataclass(frozen=True, eq=False)
class Job:
    """One piece of work: a function of a module, and what it is called with; both travel.

    Attributes
    ----------
    function : callable
    arguments : tuple
    then : callable
        Called here with the result, or with the exception; returns the work that follows.
    """

    function: Callable[..., Any]
    arguments: tuple[Any, ...]
    then: Callable[[Any], Iterable[Job]]


@dataclass(frozen=True, eq=False)
class Engine:
    """A scheduler with its workers."""

    client: Client
    _waiting: dict[Any, tuple[Job, Future[Any]]] = field(default_factory=dict)
    _done: Queue[Any] = field(default_factory=Queue)

    def run(self, jobs: Iterable[Job]) -> None:
        """Do work, and what follows from it, until nothing is left.

        Work that raises, or on which workers die, hands its exception to ``then``. So does all work that is left when
        there has been no worker for a minute.
        """
        self._submit(jobs)
        alone = 0.0
        while self._waiting:
            try:
                key = self._done.get(timeout=LOOK_SECONDS)
            except Empty:
                alone = 0.0 if self._workers() else alone + LOOK_SECONDS
                if alone >= NO_WORKER_SECONDS:
                    self._give_up()
                continue
            if key in self._waiting:
                job, future = self._waiting.pop(key)
                self._submit(job.then(_outcome(future)))
                future.release()

    def _submit(self, jobs: Iterable[Job]) -> None:
        for job in jobs:
            future = self.client.submit(job.function, *job.arguments, pure=False)
            self._waiting[future.key] = job, future
            future.add_done_callback(lambda done: self._done.put(done.key))

    def _workers(self) -> int:
        with suppress(OSError):
            return len(self.client.scheduler_info(n_workers=-1)["workers"])
        return 0

    def _give_up(self) -> None:
        while self._waiting:
            _, (job, future) = self._waiting.popitem()
            with suppress(Exception):
                future.cancel()
            _refuse(job)


def _refuse(job: Job) -> None:
    """Tell work, and all that follows from it, that nobody does it."""
    for more in job.then(ScaraIdentError("no worker is left; start workers and run again to continue")):
        _refuse(more)


@contextmanager
def started(scheduler: str | None = None, workers: int | None = None) -> Iterator[Engine]:
    """Start workers on this machine, or join a cluster.

    Parameters
    ----------
    scheduler : str, optional
        Address of a Dask scheduler, as ``tcp://host:8786``; its workers have this package installed. Without it workers
        are processes of this machine, with one BLAS thread each.
    workers : int, optional
        How many processes; by default one for each core.

    Raises
    ------
    UsageError
        If Dask is not installed, or no scheduler answers.
    """
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError:
        raise UsageError(f"fleet: its engine, dask.distributed, is missing; {INSTALL}") from None
    quiet = {
        "distributed.scheduler.allowed-failures": MAX_DEATHS,
        "distributed.comm.timeouts.connect": CONNECT_SECONDS,
        # Work may start a process of its own, which a daemon may not.
        "distributed.worker.daemon": False,
        # Else every array is asked of the system anew and given back, and every 10 ms is looked what a worker does: together
        # as much as the work.
        "distributed.nanny.pre-spawn-environ.MALLOC_MMAP_THRESHOLD_": KEPT_ARRAY,
        "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": KEPT_MEMORY,
        "distributed.worker.profile.enabled": False,
        # What a dashboard would show costs more than handing out the work.
        "distributed.admin.system-monitor.interval": "10s",
        "distributed.admin.tick.interval": "1s",
    }
    log = logging.getLogger("distributed")
    level = log.level
    with dask.config.set(quiet):
        try:
            log.setLevel(logging.CRITICAL)
            if scheduler is not None:
                try:
                    client = Client(scheduler, set_as_default=False)
                except (OSError, ValueError, TimeoutError) as error:
                    reason = (str(error) or type(error).__name__).splitlines()[0]
                    raise UsageError(
                        f"{scheduler}: no scheduler answers there ({reason}); start one with: dask scheduler"
                    ) from None
                with client:
                    yield Engine(client)
                return
            count = workers or available_cores()
            with ExitStack() as stack:
                spawned = dask.config.get("distributed.nanny.pre-spawn-environ")
                stack.enter_context(_environment_kept((*spawned, *DASK_VARIABLES)))
                # Its processes, and those that stand in for them later, hear of no Ctrl-C: they are ended from here. Python's
                # own process beside them is there before, as what starts it lets Ctrl-C through again.
                resource_tracker.ensure_running()
                with uninterrupted():
                    cluster = stack.enter_context(
                        LocalCluster(
                            n_workers=count,
                            threads_per_worker=1,
                            processes=True,
                            dashboard_address="localhost:0",
                            memory_limit=0,
                            silence_logs=logging.CRITICAL,
                        )
                    )
                    client = stack.enter_context(Client(cluster, set_as_default=False))
                yield Engine(client)
        finally:
            log.setLevel(level)


@contextmanager
def _environment_kept(names: Iterable[str]) -> Iterator[None]:
    """Put back variables of the environment, into which Dask writes what the processes that it starts are to have."""
    before = {name: os.environ.get(name) for name in names}
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def run_all(
    function: Callable[..., Result],
    items: Sequence[tuple[Any, ...]],
    scheduler: str | None = None,
    *,
    workers: int | None = None,
    ended: Callable[[int, Result], None] | None = None,
) -> list[Result]:
    """Call a function with each of many arguments, on processes of this machine or of a cluster.

    All is done before what failed is raised. Processes of this machine are started anew, so a script calls this under
    ``if __name__ == "__main__"``.

    Parameters
    ----------
    function : callable
        Of a module that the workers have too.
    items : sequence of tuple
        Arguments of each call; they travel, as do the results.
    scheduler, workers
        See `started`.
    ended : callable, optional
        Called here with the place and the result of each call as it ends.

    Returns
    -------
    list
        Results in the order of the items.

    Raises
    ------
    Exception
        What the first of the calls that failed raised.
    """
    found: list[Any] = [None] * len(items)

    def take(place: int, outcome: Any) -> Iterable[Job]:
        found[place] = outcome
        if ended is not None and not isinstance(outcome, Exception):
            ended(place, outcome)
        return ()

    if items:
        with started(scheduler, workers) as engine:
            engine.run(Job(function, item, partial(take, place)) for place, item in enumerate(items))
    for outcome in found:
        if isinstance(outcome, Exception):
            raise outcome
    return found


def _outcome(future: Future[Any]) -> Any:
    from distributed import KilledWorker

    try:
        return future.result()
    except KilledWorker:
        return ProcessEnded(
            f"{MAX_DEATHS + 1} workers died on it, for example because a file is damaged or memory ran out; `scara-ident identify` "
            "on its recordings names such a file"
        )
    except Exception as error:
        return error
