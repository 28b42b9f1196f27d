"""Work on several cores in one order."""

from __future__ import annotations

import gc
import multiprocessing
import os
import pickle
import signal
import threading
import time
import weakref
from pathlib import Path
from threading import Thread
from typing import Any

import pytest

from scara_ident import processes
from scara_ident.errors import ProcessEnded, ScaraIdentError
from scara_ident.processes import available_cores, beside, each_beside, halved, map_in_order, own_process
from scara_ident.threads import one_thread, side_by_side
from tests.shared import PATIENCE


@pytest.mark.slow
@pytest.mark.parametrize("processes", [1, 2, 3])
def test_results_do_not_depend_on_the_number_of_processes(processes: int):
    # A function that holds another cannot be sent to a process; a fork has it.
    def work(item: int) -> tuple[int, int]:
        return item, (lambda x: x**2)(item)

    assert list(map_in_order(work, iter(range(7)), processes)) == [(k, k * k) for k in range(7)]


@pytest.mark.slow
def test_the_work_is_done_in_other_processes_where_there_may_be_several():
    assert os.getpid() not in set(map_in_order(lambda _: os.getpid(), range(4), 2))
    assert set(map_in_order(lambda _: os.getpid(), range(4), 1)) == {os.getpid()}


@pytest.mark.slow
def test_as_many_items_as_workers_go_to_one_each():
    assert len(set(map_in_order(lambda _: os.getpid(), range(2), 2))) == 2


def test_without_fork_the_items_are_worked_on_here(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(processes.multiprocessing, "get_all_start_methods", lambda: ["spawn"])
    assert set(map_in_order(lambda _: os.getpid(), range(4), 2)) == {os.getpid()}


@pytest.mark.slow
@pytest.mark.parametrize("processes", [1, 2])
def test_an_error_reaches_the_caller_behind_the_results_before_it(processes: int):
    results = map_in_order(lambda x: 6 // (2 - x), range(4), processes)
    assert [next(results), next(results)] == [3, 6]
    with pytest.raises(ZeroDivisionError):
        next(results)


def test_nothing_to_do_gives_nothing():
    assert list(map_in_order(lambda x: x, [], 2)) == []


def test_no_more_cores_are_used_than_this_process_may(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: {3}, raising=False)
    assert available_cores() == 1
    assert set(map_in_order(lambda _: os.getpid(), range(3))) == {os.getpid()}


@pytest.mark.slow
@pytest.mark.usefixtures("two_cores")
def test_what_is_done_beside_is_done_in_another_process_on_threads_of_its_own():
    def work() -> tuple[int, list[int]]:
        return os.getpid(), side_by_side(lambda x: x * x, range(5))

    assert work()[1] == [0, 1, 4, 9, 16]
    with beside(work) as result:
        process, squares = result()
    assert process != os.getpid()
    assert squares == [0, 1, 4, 9, 16]


class Large:
    """What a task holds, whose memory is to be free once it is done."""


@pytest.mark.slow
@pytest.mark.usefixtures("two_cores")
def test_a_worker_keeps_nothing_of_what_it_has_done():
    def work(item: int) -> bool:
        held = Large()
        side_by_side(lambda one: one is not None, [held] * 3)
        gone = weakref.ref(held)
        del held
        gc.collect()
        return gone() is None

    # The caller has threads by now, which its workers do not have.
    assert side_by_side(abs, [-1, 2]) == [1, 2]
    assert list(map_in_order(work, range(4), 2)) == [True] * 4
    with beside(lambda: work(0)) as result:
        assert result()


@pytest.mark.slow
@pytest.mark.usefixtures("two_cores")
def test_workers_beside_each_other_have_one_thread_each_and_one_alone_has_its_own_two():
    def work(_: int = 0) -> int:
        return len(set(side_by_side(lambda _: (time.sleep(0.01), threading.get_ident())[1], range(8))))

    assert side_by_side(abs, [-1, 2]) == [1, 2]
    assert list(map_in_order(work, range(4), 2)) == [1] * 4

    def meet() -> int:
        both = threading.Barrier(2)
        return len(set(side_by_side(lambda _: (both.wait(PATIENCE), threading.get_ident())[1], range(2))))

    with beside(meet) as result:
        assert result() == 2


def test_without_fork_what_is_done_beside_is_done_here(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(processes.multiprocessing, "get_all_start_methods", lambda: ["spawn"])
    with beside(os.getpid) as result:
        assert result() == os.getpid()


def test_an_error_of_what_is_done_beside_reaches_who_waits():
    with beside(lambda: 1 // 0) as result:
        for _ in range(2):
            with pytest.raises(ZeroDivisionError):
                result()


def where(item: int) -> tuple[int, int]:
    return item, os.getpid()


def test_half_of_the_work_is_done_in_another_process_in_the_order_of_the_items(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(processes, "available_cores", lambda: 2)
    with own_process():
        found = halved(where, range(5), [1.0, 4.0, 1.0, 1.0, 1.0])
    assert [item for item, _ in found] == list(range(5))
    alone = [item for item, process in found if process == found[1][1]]
    assert alone == [1]
    assert os.getpid() in {process for _, process in found}
    with own_process(), pytest.raises(ZeroDivisionError):
        halved(lambda x: 1 // (3 - x), range(5), [1.0] * 5)


@pytest.mark.parametrize("why", ["one core", "beside others", "a thread", "a worker", "one item", "another's program"])
def test_it_is_all_done_here_where_no_other_process_is_wanted(why: str, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(processes, "available_cores", lambda: 1 if why == "one core" else 2)
    items = range(1 if why == "one item" else 4)
    found: list[tuple[int, int]] = []

    def work() -> None:
        found.extend(halved(where, items, [1.0] * len(items)))

    if why == "another's program":
        work()
    elif why == "beside others":
        with own_process(), one_thread():
            work()
    elif why == "a thread":
        with own_process():
            thread = Thread(target=work)
            thread.start()
            thread.join()
    else:
        if why == "a worker":
            # As multiprocessing marks the processes of a pool, which may start none.
            monkeypatch.setitem(multiprocessing.current_process()._config, "daemon", True)
        with own_process():
            work()
    assert found == [(item, os.getpid()) for item in items]


@pytest.mark.slow
def test_ctrl_c_reaches_the_caller_alone_and_ends_the_others_at_once(capfd: pytest.CaptureFixture[str]):
    def work(item: int) -> int:
        # As a terminal does, to all processes of a command.
        os.kill(os.getpid(), signal.SIGINT)
        if item == 1:
            os.kill(caller, signal.SIGINT)
            time.sleep(60.0)
        return os.getpid()

    caller, before, found = os.getpid(), signal.signal(signal.SIGINT, signal.default_int_handler), list[int]()
    start, others = time.monotonic(), multiprocessing.active_children()
    try:
        with pytest.raises(KeyboardInterrupt):
            found.extend(map_in_order(work, range(4), 2))
        with pytest.raises(KeyboardInterrupt), beside(lambda: work(1)) as result:
            result()
    finally:
        signal.signal(signal.SIGINT, before)
    assert time.monotonic() - start < 30.0
    # Workers of another test may be there still.
    assert set(multiprocessing.active_children()) <= set(others)
    assert capfd.readouterr() == ("", "")


@pytest.mark.slow
def test_a_process_that_dies_and_a_result_that_cannot_travel_are_said():
    with pytest.raises(ScaraIdentError, match="ended from outside"):
        list(map_in_order(lambda item: os.kill(os.getpid(), signal.SIGKILL) or item, range(4), 2))
    with (
        pytest.raises((AttributeError, TypeError, pickle.PicklingError), match="lambda"),
        beside(lambda: lambda: 1) as result,
    ):
        result()
    with pytest.raises(ZeroDivisionError) as caught:
        list(map_in_order(lambda item: item // 0, range(2), 2))
    assert "item // 0" in "".join(caught.value.__notes__)


@pytest.mark.slow
def test_whose_result_nobody_waits_for_is_not_waited_for():
    start = time.monotonic()
    with beside(lambda: time.sleep(60.0)):
        pass
    results = map_in_order(lambda item: time.sleep(60.0 * (item > 1)), range(4), 2)
    next(results)
    results.close()
    assert time.monotonic() - start < 30.0


@pytest.fixture
def a_command():
    with own_process():
        yield


@pytest.mark.slow
@pytest.mark.usefixtures("a_command")
def test_each_is_done_beside_and_one_that_ends_its_process_takes_no_other_with_it(tmp_path: Path):
    def work(item: int) -> tuple[int, int]:
        turn = tmp_path / f"{item}"
        again = turn.exists()
        turn.touch()
        if item in (0, 3) or (item == 2 and not again):
            os.kill(os.getpid(), signal.SIGKILL)
        return 6 // (item - 1), os.getpid()

    with each_beside(work, range(6)) as wanted:
        found = wanted()
    assert [found[k]()[0] for k in (2, 4, 5)] == [6, 2, 1]
    assert os.getpid() not in {found[k]()[1] for k in (2, 4, 5)}
    for place, error in ((0, ProcessEnded), (1, ZeroDivisionError), (3, ProcessEnded)):
        for _ in range(2):
            with pytest.raises(error):
                found[place]()


@pytest.mark.slow
@pytest.mark.usefixtures("a_command")
def test_each_is_sent_as_soon_as_it_is_there_and_only_what_is_done_is_waited_for():
    # More than a pipe holds: with nobody who takes it, a process would not get to the second.
    before, start = set(multiprocessing.active_children()), time.monotonic()
    with each_beside(lambda item: b"0" * 10_000_000, range(3)) as wanted:
        assert [len(found()) for found in wanted()] == [10_000_000] * 3
    with each_beside(lambda item: time.sleep(60.0), range(2)):
        pass
    assert time.monotonic() - start < 30.0
    assert set(multiprocessing.active_children()) <= before


@pytest.mark.usefixtures("a_command")
def test_one_whose_result_is_too_large_to_be_taken_is_as_one_that_ends_its_process(monkeypatch: pytest.MonkeyPatch):
    loads = pickle.loads

    def small(sent: bytes) -> Any:
        if len(sent) > 1000:
            raise MemoryError
        return loads(sent)

    monkeypatch.setattr(processes.pickle, "loads", small)
    with each_beside(lambda item: b"0" * 10**item, range(1, 5, 3)) as wanted:
        one, other = wanted()
    assert one() == b"0" * 10
    with pytest.raises(ProcessEnded):
        other()


def test_in_another_s_program_each_is_done_there_when_it_is_asked_for_and_once():
    done = list[int]()
    with each_beside(lambda item: (done.append(item), os.getpid())[1], range(2)) as wanted:
        first, second = wanted()
        assert done == []
        assert second() == second() == os.getpid()
    assert done == [1]
    assert first() == os.getpid()
