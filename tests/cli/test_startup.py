"""A command begins and ends sooner, and does the same."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from scara_ident.cli import startup
from scara_ident.cli.startup import read_beside
from scara_ident.errors import RecordingError
from scara_ident.recording import recording
from scara_ident.robot.robot import Robot, load_robot
from tests.shared import ROOT


def printed(program: str) -> list[str]:
    """Run lines of Python in a process of their own and return what they print."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "OPENBLAS_NUM_THREADS": "3"}
    done = subprocess.run([sys.executable, "-c", program], env=environment, capture_output=True, text=True, check=True)
    return done.stdout.split()


def test_scipy_is_loaded_when_it_is_used_and_its_blas_has_one_thread_then() -> None:
    program = """
import sys
from scara_ident.cli.startup import begin_soon
from scara_ident.threads import one_blas_thread
begin_soon()
with one_blas_thread():
    print("scipy.linalg" in sys.modules)
    import scipy.linalg
    from threadpoolctl import threadpool_info
    print({item["num_threads"] for item in threadpool_info() if item["user_api"] == "blas"})
"""
    assert printed(program) == ["False", "{1}"]


def test_what_goes_with_the_process_is_not_looked_through_for_garbage() -> None:
    program = """
import atexit, gc
from scara_ident.cli.startup import begin_soon
atexit.register(lambda: print(gc.get_freeze_count() > 0))
begin_soon()
print(gc.get_freeze_count())
"""
    assert printed(program) == ["0", "True"]


ARM = load_robot()


def where(words: Sequence[Path | str], arm: Robot) -> tuple[int, int]:
    """Stands for reading: where it is done, and how much is to be read."""
    return os.getpid(), len(words)


@pytest.fixture(autouse=True)
def without_polars(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "polars", raising=False)


def test_small_recordings_are_read_in_another_process_and_large_ones_here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(recording, "read_usable", where)
    path = tmp_path / "OJK_1.csv"
    path.write_text("time\n0\n", encoding="utf-8")
    with read_beside(ARM, [path], [], [str(tmp_path)]) as wanted:
        read = wanted()
    assert [count for _, count in read] == [1, 0, 1]
    assert {process for process, _ in read} != {os.getpid()}
    assert len({process for process, _ in read}) == 1
    monkeypatch.setattr(startup, "SMALL", 6)
    with read_beside(ARM, [path]) as wanted:
        assert wanted() == [(os.getpid(), 1)]


def test_what_has_threads_that_a_fork_would_lack_reads_here(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(recording, "read_usable", where)
    monkeypatch.setitem(sys.modules, "polars", sys)
    with read_beside(ARM, []) as wanted:
        assert wanted() == [(os.getpid(), 0)]


def test_what_is_wrong_with_a_recording_reaches_who_waits_for_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(words: Sequence[Path | str], arm: Robot) -> None:
        raise RecordingError("OJK_1.csv: no numbers; record again")

    monkeypatch.setattr(recording, "read_usable", refuse)
    with pytest.raises(RecordingError, match="no numbers"), read_beside(ARM, []) as wanted:
        wanted()
