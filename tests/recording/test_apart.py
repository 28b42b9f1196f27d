"""Recordings are read in another process of a command, and one that crashes what reads it is named."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from scara_ident.errors import RecordingError, UsageError
from scara_ident.processes import own_process
from scara_ident.recording import apart
from scara_ident.recording.apart import read_apart, read_usable, usable_beside
from scara_ident.robot.robot import Robot, load_robot
from tests.shared import ROOT

ARM = load_robot()


@pytest.fixture(autouse=True)
def a_command_without_polars(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.delitem(sys.modules, "polars", raising=False)
    with own_process():
        yield


def files(folder: Path, *names: str) -> list[Path]:
    found = [folder / f"{name}.csv" for name in names]
    for path in found:
        path.write_text("time\n0\n", encoding="utf-8")
    return found


def stand_in(monkeypatch: pytest.MonkeyPatch, crash: str = "", refuse: str = "") -> None:
    """Let a recording be its name and where it was read; one of a name ends its process, one is refused."""

    def read(path: Path, arm: Robot) -> tuple[str, int]:
        if path.stem == crash:
            os.kill(os.getpid(), signal.SIGKILL)
        if path.stem == refuse:
            raise RecordingError(f"{path}: no numbers; record again")
        return path.stem, os.getpid()

    monkeypatch.setattr(apart, "read_recording", read)
    monkeypatch.setattr(apart, "distinctly_named", tuple)


def test_recordings_are_read_in_one_other_process_and_each_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(monkeypatch)
    first, second = files(tmp_path, "OJD_1", "OJK_1")
    with usable_beside(ARM, [first], [], [str(tmp_path)]) as wanted:
        (one, _), (none, _), (all_there, said) = wanted()
    assert [name for name, _ in all_there] == ["OJD_1", "OJK_1"]
    assert one[0] is all_there[0]
    assert none == () and said == []
    (process,) = {process for _, process in all_there}
    assert process != os.getpid()
    assert second.exists()


@pytest.mark.parametrize("why", ["polars", "no command"])
def test_where_nothing_may_be_forked_they_are_read_here_and_once(
    why: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stand_in(monkeypatch)
    files(tmp_path, "OJD_1")
    if why == "polars":
        monkeypatch.setitem(sys.modules, "polars", sys)
    else:
        from scara_ident import processes

        token = processes._OWN.set(False)
    with usable_beside(ARM, [tmp_path], [tmp_path]) as wanted:
        ((first,), _), ((second,), _) = wanted()
    if why == "no command":
        processes._OWN.reset(token)
    assert first == ("OJD_1", os.getpid())
    assert first is second


@pytest.mark.slow
def test_one_that_crashes_its_reader_is_left_out_and_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in(monkeypatch, crash="OJD_2", refuse="OJD_4")
    paths = files(tmp_path, "OJD_1", "OJD_2", "OJD_3", "OJD_4", "OJD_5")
    (other,) = files(tmp_path, "OJK_1")
    with usable_beside(ARM, paths, [other], []) as wanted:
        (first, said), (second, nothing), third = wanted()
    assert [name for name, _ in first] == ["OJD_1", "OJD_3", "OJD_5"]
    assert [name for name, _ in second] == ["OJK_1"]
    assert nothing == [] and third == ((), [])
    assert said == [
        f"{paths[1]}: reading it crashes, for example because the file is damaged or too large for the memory; save it again; left out",
        f"{paths[3]}: no numbers; record again; left out",
    ]


@pytest.mark.slow
@pytest.mark.parametrize("how", ["crash", "refuse"])
def test_where_no_other_is_left_it_is_an_error(how: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in(monkeypatch, **{how: "OJD_2"})
    good, bad = files(tmp_path, "OJD_1", "OJD_2")
    words = {"crash": "reading it crashes", "refuse": "no numbers"}[how]
    with usable_beside(ARM, [good], [bad]) as wanted, pytest.raises(RecordingError, match=rf"OJD_2\.csv: {words}"):
        wanted()
    with pytest.raises(RecordingError, match=words):
        read_usable([bad], ARM)


def test_one_file_that_crashes_what_reads_it_is_named(tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"OJD_2\.csv: reading it crashes"):
        read_apart(lambda path: os.kill(os.getpid(), signal.SIGKILL), tmp_path / "OJD_2.csv")


def test_what_is_no_recording_is_said_before_anything_is_read(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="no such file or folder"), usable_beside(ARM, [tmp_path / "none.csv"]):
        pass


@pytest.mark.slow
@pytest.mark.parametrize("command", ["inspect", "identify", "compare", "diagnose", "excite --known", "ask"])
def test_a_command_says_it_in_one_line(tmp_path: Path, command: str) -> None:
    (tmp_path / "recordings").mkdir()
    (bad,) = files(tmp_path / "recordings", "OJD_1")
    # As damaged and as long as what was once read in the command's own process.
    bad.write_text("time\n0\n" * 5_000_000, encoding="utf-8")
    program = f"""
import os, signal, sys
from scara_ident.cli.main import run
from scara_ident.recording.files import parquet_csv

def crash(path, *names):
    os.kill(os.getpid(), signal.SIGABRT)

parquet_csv.column_names = parquet_csv.read_columns = crash
sys.exit(run({[*command.split(), str(tmp_path if command == "ask" else bad)]!r}))
"""
    done = subprocess.run(
        [sys.executable, "-c", program], env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True
    )
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr.startswith(f"scara-ident: {bad}: reading it crashes")
    assert done.stderr.count("\n") == 1
