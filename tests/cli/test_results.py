"""Results reach the disk whole or not at all."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import polars as pl
import pytest

from scara_ident.cli.main import run
from scara_ident.files import check_output, written_together
from scara_ident.robot.robot import embedded_urdf

SMALL = 65536


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, and every folder as nothing."""
    return {str(path.relative_to(folder)): path.read_bytes() if path.is_file() else b"" for path in folder.rglob("*")}


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A file system of 64 KiB with earlier results on it."""
    place = tmp_path / "disk"
    place.mkdir()
    _mount(place, f"size={SMALL}")
    try:
        for name in ("base.json", "identification.json", "torque.png", "comparison.json", "OJK_1.parquet"):
            (place / name).write_text(f"earlier {name}")
        yield place
    finally:
        subprocess.run(["umount", str(place)], check=True)


def _mount(place: Path, options: str) -> None:
    if sys.platform != "linux" or os.geteuid() != 0:
        pytest.skip("needs a small file system, which only root may mount on Linux")
    done = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", options, "none", str(place)], capture_output=True, text=True, check=False
    )
    if done.returncode:
        pytest.skip(f"needs a small file system, which may not be mounted here: {done.stderr.strip()}")


@pytest.mark.parametrize(
    "words",
    [
        ["identify", "nowhere.csv"],
        ["diagnose", "nowhere.csv"],
        ["compare", "nowhere.csv"],
        ["simulate", "nowhere.csv"],
        ["base"],
        ["paper"],
        ["inspect", "nowhere.csv", "--urdf", embedded_urdf()],
    ],
    ids=lambda words: words[0],
)
def test_a_full_disk_is_said_before_the_work(command, disk: Path, words: list[str | Path]):
    with open(disk / "ballast", "wb", buffering=0) as ballast, pytest.raises(OSError, match="No space"):
        while True:
            ballast.write(bytes(4096))
    before = contents(disk)
    for folder in (disk, disk / "new"):
        result = command(*words, "--output", folder)
        assert result.status == 1
        assert result.out == ""
        assert f"{folder}: results cannot be written here: No space left on device; make room" in result.err
        assert contents(disk) == before


# Room for a small file, as the check before the work finds, or for the first of two, but not for the results.
@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "room"),
    [
        (["identify", "{runs}/OJD_1.parquet", "--band", "15"], 40960),
        (["compare", "{runs}"], 4096),
        (["simulate", "OJK"], 40960),
    ],
    ids=["identify", "compare", "simulate"],
)
def test_a_disk_that_fills_up_keeps_the_earlier_results(command, disk: Path, folder: Path, words: list[str], room: int):
    before = _leave(disk, room)
    result = command(*(word.replace("{runs}", str(folder)) for word in words), "--output", disk)
    assert result.status == 1
    assert "no space left on device" in result.err.lower()
    assert ".scara-ident-" not in result.err
    assert contents(disk) == before


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ["identify", "{runs}/OJD_1.parquet", "--band", "15"],
        ["simulate", "OJK"],
    ],
    ids=["identify", "simulate"],
)
def test_the_file_that_does_not_fit_is_named(command, disk: Path, folder: Path, words: list[str]):
    _leave(disk, 40960)
    result = command(*(word.replace("{runs}", str(folder)) for word in words), "--output", disk)
    assert result.err.startswith(f"scara-ident: {disk}{os.sep}")
    assert "cannot be written" in result.err


def _leave(disk: Path, room: int) -> dict[str, bytes]:
    """Fill a disk up to some room and return what is on it."""
    used = sum(-(-path.stat().st_size // 4096) * 4096 for path in disk.iterdir())
    (disk / "ballast").write_bytes(bytes(SMALL - used - room))
    return contents(disk)


def test_a_disk_that_may_only_be_read_is_said_before_the_work(command, tmp_path: Path):
    _mount(tmp_path, "ro,size=64k")
    try:
        result = command("identify", "nowhere.csv", "--output", tmp_path / "results")
        assert result.status == 1
        assert "results cannot be written here: Read-only file system; give another folder" in result.err
    finally:
        subprocess.run(["umount", str(tmp_path)], check=True)


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        ["identify", "{runs}/OJD_1.parquet", "--band", "15"],
        ["compare", "{runs}"],
        ["simulate", "{path}"],
        ["base"],
        ["inspect", "{runs}/OJD_1.parquet", "--urdf", str(embedded_urdf())],
    ],
    ids=lambda words: words[0],
)
@pytest.mark.parametrize("there", [True, False], ids=["into results", "into a new folder"])
def test_a_signal_in_the_middle_of_writing_leaves_all_as_it_was(
    folder: Path, tmp_path: Path, monkeypatch, capfd, words: list[str], there: bool
):
    path = tmp_path / "path.csv"
    pl.DataFrame({"time": [0.0, 0.5, 1.0]} | {
        f"joint{j}.{kind}": [0.0] * 3 for j in (1, 2) for kind in ("position", "velocity", "acceleration")
    }).write_csv(path)  # fmt: skip
    out = tmp_path / "results"
    if there:
        out.mkdir()
        for name in ("identification.json", "torque.png", "report.html", "comparison.json", "base.json"):
            (out / name).write_text("earlier")
    whole = Path.write_text
    before = contents(tmp_path)
    written: list[str] = []

    def interrupted(self: Path, text: str, *rest: object, **named: object) -> int:
        whole(self, text[: len(text) // 2])
        written.append(self.name)
        signal.raise_signal(signal.SIGTERM if there else signal.SIGINT)
        raise AssertionError("the signal did not interrupt")

    given = [word.replace("{runs}", str(folder)).replace("{path}", str(path)) for word in words]
    # A run in the background of a shell begins with interrupts ignored.
    ignored = signal.signal(signal.SIGINT, signal.default_int_handler)
    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_text", interrupted)
        status = run([*given, "--output", str(out)])
    signal.signal(signal.SIGINT, ignored)
    assert status == (143 if there else 130)
    assert len(written) == 1
    what = "ended by a signal" if there else "interrupted"
    assert capfd.readouterr().err == f"scara-ident: {what}; no file is left half-written\n"
    assert contents(tmp_path) == before


def test_results_move_into_place_together(tmp_path: Path):
    (tmp_path / "a").write_text("earlier")
    with pytest.raises(ZeroDivisionError), written_together(tmp_path) as place:
        (place / "a").write_text("new")
        (place / "b").write_text(str(1 / 0))
    assert contents(tmp_path) == {"a": b"earlier"}
    with written_together(tmp_path) as place:
        (place / "a").write_text("new")
        (place / "b").write_text("new")
        assert (tmp_path / "a").read_text() == "earlier"
    assert contents(tmp_path) == {"a": b"new", "b": b"new"}


def test_a_folder_with_the_name_of_a_result_is_said_and_kept(command, tmp_path: Path, folder: Path):
    (tmp_path / "torque.png").mkdir()
    result = command("identify", folder / "OJD_1.parquet", "--band", "15", "--output", tmp_path)
    assert result.status == 1
    assert f"{tmp_path / 'torque.png'}: cannot be written: a folder has this name" in result.err
    assert contents(tmp_path) == {"torque.png": b""}


def test_looking_at_an_output_folder_leaves_it_as_it_was(tmp_path: Path):
    check_output(None)
    check_output(tmp_path)
    check_output(tmp_path / "a" / "b" / "c")
    assert list(tmp_path.iterdir()) == []
