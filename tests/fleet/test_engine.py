"""Work on real processes: what raises or dies takes nothing else with it."""

from __future__ import annotations

import builtins
import os
import signal
import time
from pathlib import Path

import pytest

from scara_ident.errors import ProcessEnded, ScaraIdentError, UsageError
from scara_ident.fleet import engine as module
from scara_ident.fleet.engine import Engine, Job, run_all, started


def double(x: int) -> int:
    if x < 0:
        raise ValueError("negative")
    return 2 * x


def die_once(flag: str) -> str:
    if not Path(flag).exists():
        Path(flag).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "lived"


def die() -> None:
    os.kill(os.getpid(), signal.SIGABRT)


def interrupted(x: int) -> int:
    os.kill(os.getpid(), signal.SIGINT)
    time.sleep(0.5)
    return x


@pytest.mark.slow
def test_ctrl_c_is_for_who_started_the_processes_alone_and_their_environment_for_them(capfd, monkeypatch):
    monkeypatch.delenv("OMP_NUM_THREADS", raising=False)
    # As many workers as cores, also on systems that do not say which of them a process may use.
    monkeypatch.delattr(os, "sched_getaffinity")
    monkeypatch.setattr(os, "cpu_count", lambda: 1)
    before = dict(os.environ)
    assert run_all(interrupted, [(1,)]) == [1]
    assert capfd.readouterr() == ("", "")
    # What came later in this process was told by it to keep memory as workers do, and to have one BLAS thread.
    assert dict(os.environ) == before


@pytest.mark.slow
def test_what_raises_hands_on_its_exception_and_what_follows_is_done(cluster, tmp_path):
    found: list[object] = []

    def then(outcome):
        found.append(outcome)
        return [Job(double, (outcome,), then)] if isinstance(outcome, int) and outcome < 10 else ()

    flag = str(tmp_path / "flag")
    with started(cluster.scheduler_address) as engine:
        engine.run([Job(double, (3,), then), Job(double, (-1,), then), Job(die_once, (flag,), then)])
        engine.run([])
    assert sorted(str(item) for item in found) == ["12", "6", "lived", "negative"]


@pytest.mark.slow
def test_work_on_which_all_workers_die_says_what_to_look_at(monkeypatch):
    # Each that stands in for a dead one takes a second to begin.
    monkeypatch.setattr(module, "MAX_DEATHS", 1)
    with pytest.raises(
        ProcessEnded, match=r"2 workers died on it, for example because a file is damaged .* names such a file"
    ):
        run_all(die, [()], workers=1)


@pytest.mark.slow
def test_many_calls_give_their_results_in_order_and_raise_when_all_is_done(cluster):
    seen: dict[int, int] = {}
    address = cluster.scheduler_address
    assert run_all(double, [(k,) for k in range(5)], address, ended=seen.__setitem__) == [0, 2, 4, 6, 8]
    assert seen == {k: 2 * k for k in range(5)}
    seen.clear()
    with pytest.raises(ValueError, match="negative"):
        run_all(double, [(-1,), (4,)], address, ended=seen.__setitem__)
    assert seen == {1: 8}
    assert run_all(double, []) == []


def test_without_workers_all_that_is_left_is_refused(monkeypatch):
    class Never:
        key = "key"

        def add_done_callback(self, _):
            pass

        def cancel(self):
            pass

    class Client:
        def submit(self, *_, **__):
            return Never()

        def scheduler_info(self, **_):
            return {"workers": {}}

    monkeypatch.setattr(module, "LOOK_SECONDS", 0.01)
    monkeypatch.setattr(module, "NO_WORKER_SECONDS", 0.02)
    found: list[object] = []

    def then(outcome):
        found.append(outcome)
        return [Job(double, (1,), lambda later: found.append(later) or ())] if len(found) == 1 else ()

    Engine(Client()).run([Job(double, (1,), then)])
    assert len(found) == 2 and all(isinstance(item, ScaraIdentError) for item in found)


@pytest.mark.slow
def test_no_scheduler_and_no_dask_are_one_line(monkeypatch):
    monkeypatch.setattr(module, "CONNECT_SECONDS", "200ms")
    with pytest.raises(UsageError, match="no scheduler answers there"), started("tcp://127.0.0.1:9"):
        pass
    real = builtins.__import__

    def absent(name, *rest):
        if name == "dask":
            raise ImportError
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", absent)
    with pytest.raises(UsageError, match=r'pip install "scara-ident\[fleet\]"'), started():
        pass
