"""Recordings are read in another process, and one that crashes what reads it is named."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from scara_ident.cli import reading
from scara_ident.cli.reading import read_apart, read_beside
from scara_ident.errors import RecordingError
from scara_ident.recording import recording
from scara_ident.robot.robot import Robot, load_robot
from tests.shared import ROOT

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
    monkeypatch.setattr(reading, "SMALL", 6)
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


def files(folder: Path, *names: str) -> list[Path]:
    found = [folder / f"{name}.csv" for name in names]
    for path in found:
        path.write_text("time\n0\n", encoding="utf-8")
    return found


def crash_on(monkeypatch: pytest.MonkeyPatch, *names: str) -> None:
    """Let what reads a recording of these names end its process."""

    def read(path: Path, arm: Robot) -> str:
        if Path(path).stem in names:
            os.kill(os.getpid(), signal.SIGKILL)
        return Path(path).stem

    def usable(words: Sequence[Path], arm: Robot) -> tuple[tuple[str, ...], list[str]]:
        return tuple(read(path, arm) for path in words), []

    monkeypatch.setattr(recording, "read_recording", read)
    monkeypatch.setattr(recording, "read_usable", usable)


def test_a_recording_that_crashes_its_reader_is_left_out_and_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    good, bad, other = files(tmp_path, "OJD_1", "OJD_2", "OJK_1")
    crash_on(monkeypatch, "OJD_2")
    with read_beside(ARM, [good, bad], [other], []) as wanted:
        (first, said), second, third = wanted()
    assert (first, second, third) == (("OJD_1",), (("OJK_1",), []), ((), []))
    assert said == [
        f"{bad}: what reads it crashes, as on a file that is damaged or too large for the memory; save it again; left out"
    ]


def test_where_no_other_is_left_it_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    good, bad = files(tmp_path, "OJD_1", "OJD_2")
    crash_on(monkeypatch, "OJD_2")
    with (
        pytest.raises(RecordingError, match=r"OJD_2\.csv: what reads it crashes"),
        read_beside(ARM, [good], [bad]) as wanted,
    ):
        wanted()
    with pytest.raises(RecordingError, match=r"OJD_2\.csv: what reads it crashes"):
        read_apart(lambda: os.kill(os.getpid(), signal.SIGKILL), bad)


def test_a_process_that_ended_for_another_reason_is_given_a_second_turn(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (good,) = files(tmp_path, "OJD_1")
    turn = tmp_path / "turn"

    def usable(words: Sequence[Path], arm: Robot) -> tuple[tuple[str, ...], list[str]]:
        if not turn.exists():
            turn.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return ("OJD_1",), []

    monkeypatch.setattr(recording, "read_recording", lambda path, arm: path)
    monkeypatch.setattr(recording, "read_usable", usable)
    with read_beside(ARM, [good]) as wanted:
        assert wanted() == [(("OJD_1",), [])]


@pytest.mark.parametrize("command", ["inspect", "identify", "compare", "diagnose", "excite --known"])
def test_a_command_says_it_in_one_line(tmp_path: Path, command: str) -> None:
    (bad,) = files(tmp_path, "OJD_1")
    program = f"""
import os, signal, sys
from scara_ident.cli.main import run
from scara_ident.recording.files import parquet_csv

def crash(path, *names):
    os.kill(os.getpid(), signal.SIGABRT)

parquet_csv.column_names = parquet_csv.read_columns = crash
sys.exit(run({[*command.split(), str(bad)]!r}))
"""
    done = subprocess.run(
        [sys.executable, "-c", program], env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True
    )
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.startswith(f"scara-ident: {bad}: what reads it crashes")
    assert done.stderr.count("\n") == 1
