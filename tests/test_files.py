"""Result files are written whole or not at all, and JSON is JSON."""

from __future__ import annotations

import errno
import json
import os
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from scara_ident.errors import ScaraIdentError
from scara_ident.files import (
    _unfinished,
    check_output,
    foreign_letter,
    path_fault,
    plain,
    real_path,
    slug,
    why_unwritten,
    write_json,
    write_text,
    write_whole,
)


def refuse(constant: str) -> None:
    raise AssertionError(f"{constant} is not JSON")


def test_json_has_no_nan_and_no_infinity(tmp_path: Path):
    path = tmp_path / "deep" / "er" / "a.json"
    write_json(path, {"a": np.nan, "b": [np.inf, -np.inf, np.float64(1.5)], "c": {"d": (np.float32("nan"), 2)}})
    found = json.loads(path.read_text(), parse_constant=refuse)
    assert found == {"a": None, "b": [None, None, 1.5], "c": {"d": [None, 2]}}


def test_numbers_of_numpy_become_numbers():
    made = plain({"i": np.int64(3), "t": np.bool_(True), "a": np.array([[1.0, np.nan]]), 1: "x", "n": None})
    assert made == {"i": 3, "t": True, "a": [[1.0, None]], "1": "x", "n": None}
    assert [type(made[key]) for key in ("i", "t")] == [int, bool]


def test_numbers_keep_all_their_digits(tmp_path: Path):
    value = 0.1 + 0.2
    write_json(tmp_path / "a.json", {"x": value})
    assert json.loads((tmp_path / "a.json").read_text())["x"] == value


def test_an_existing_file_stays_until_the_new_one_is_complete(tmp_path: Path):
    path = tmp_path / "a.txt"
    path.write_text("old")

    def fails(temporary: Path) -> None:
        temporary.write_text("half of the ne")
        raise KeyError("in the middle")

    with pytest.raises(KeyError):
        write_whole(path, fails)
    assert path.read_text() == "old"
    assert [file.name for file in tmp_path.iterdir()] == ["a.txt"]
    write_text(path, "new")
    assert path.read_text() == "new"
    assert [file.name for file in tmp_path.iterdir()] == ["a.txt"]


def test_others_may_read_what_was_written(tmp_path: Path):
    write_text(tmp_path / "a.txt", "x")
    assert stat.S_IMODE((tmp_path / "a.txt").stat().st_mode) == 0o644


def test_the_temporary_file_has_the_suffix_and_stands_beside(tmp_path: Path):
    seen: list[Path] = []
    write_whole(tmp_path / "a.png", lambda path: seen.append(path))
    assert seen[0].suffix == ".png"
    assert seen[0].parent == tmp_path


def test_a_file_where_a_folder_is_expected_is_one_line(tmp_path: Path):
    (tmp_path / "out").write_text("a file")
    with pytest.raises(ScaraIdentError, match="cannot be written") as caught:
        write_json(tmp_path / "out" / "a.json", {})
    assert str(tmp_path / "out") in str(caught.value)
    assert "\n" not in str(caught.value)
    (tmp_path / "b.json").mkdir()
    with pytest.raises(ScaraIdentError, match=r"b\.json: cannot be written"):
        write_json(tmp_path / "b.json", {})
    assert sorted(file.name for file in tmp_path.iterdir()) == ["b.json", "out"]


@pytest.mark.parametrize(
    ("name", "made"),
    [
        ("scara03", "scara03"),
        ("my arm_2.1+b", "my arm_2.1+b"),
        ("Ärmchen", "Ärmchen"),
        ("../../../PWNED", "PWNED"),
        ("/etc/passwd", "etc-passwd"),
        ("C:\\arm", "C-arm"),
        ("a\0b\nc\ud800", "a-b-c"),
        (".hidden", "hidden"),
        ("", "robot"),
        (" .. ", "robot"),
        ("\0", "robot"),
        ("x" * 1000, "x" * 200),
        ("é" * 150, "é" * 100),
    ],
)
def test_a_name_out_of_a_file_names_a_file_and_no_folder(tmp_path: Path, name: str, made: str):
    assert slug(name, "robot") == made
    write_text(tmp_path / f"{slug(name, 'robot')}_identified.urdf", "text")
    assert [path.parent for path in tmp_path.iterdir()] == [tmp_path]


def test_paths_that_are_none_are_reported_and_rings_of_links_have_no_end(tmp_path: Path):
    assert path_fault(tmp_path / "é") is None
    assert path_fault("a\0b") == "a?b: has a null byte in its name; correct the name"
    assert path_fault("a\udcff") == "a?: its name is not text in UTF-8; rename it"
    (tmp_path / "ring").symlink_to("ring")
    (tmp_path / "way").symlink_to("end")
    assert real_path(tmp_path / "ring").name == "ring"
    assert real_path(tmp_path / "way").name == "end"


def test_what_a_dead_process_left_is_swept_and_nothing_else(tmp_path: Path):
    dead = subprocess.Popen([sys.executable, "-c", ""])
    dead.wait()
    own = _unfinished(tmp_path)
    left = [tmp_path / own.name.replace(str(os.getpid()), str(dead.pid)), tmp_path / f"{own.name}.json"]
    left[1] = left[1].with_name(left[1].name.replace(str(os.getpid()), str(dead.pid)))
    kept = [own, tmp_path / ".scara-ident-0badbeef-1-00000000", tmp_path / ".scara-ident-x", tmp_path / "report.html"]
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "mine").touch()
    left[0].mkdir()
    (left[0] / "half").touch()
    left[1].symlink_to(elsewhere)
    for path in kept:
        path.touch()
    check_output(tmp_path)
    assert sorted(tmp_path.iterdir()) == sorted([*kept, elsewhere])
    assert (elsewhere / "mine").exists()


@pytest.mark.parametrize("together", [True, False])
def test_a_disk_that_is_full_leaves_nothing_half_written(tmp_path: Path, together: bool):
    (tmp_path / "a.json").write_text("old")
    program = """
import resource, sys
from pathlib import Path
from scara_ident.errors import ScaraIdentError
from scara_ident.files import written_together, write_text
resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))
folder = Path(sys.argv[1])
try:
    if sys.argv[2] == "True":
        with written_together(folder) as place:
            write_text(place / "b.json", "new")
            write_text(place / "a.json", "x" * 30000)
    else:
        write_text(folder / "a.json", "x" * 30000)
except ScaraIdentError as error:
    print(error)
"""
    told = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path), str(together)], capture_output=True, text=True, check=True
    )
    assert "cannot be written" in told.stdout
    assert len(told.stdout.splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]
    assert (tmp_path / "a.json").read_text() == "old"


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)), "No space left on device; make room or give another folder"),
        # As Polars has it.
        (OSError("No space left on device (os error 28)"), "No space left on device; make room or give another folder"),
        (ValueError("parquet: IO error: No space left on device"), "No space left on device; make room or give another folder"),
        (OSError(errno.EDQUOT, os.strerror(errno.EDQUOT)), "Disk quota exceeded; make room or give another folder"),
        (PermissionError(errno.EACCES, "Permission denied"), "Permission denied; give another folder"),
        (NotADirectoryError(errno.ENOTDIR, "Not a directory"), "is a file; give another folder"),
    ],
)  # fmt: skip
def test_why_something_is_not_written_ends_in_what_to_do(error: Exception, words: str):
    assert why_unwritten(error) == words


def test_a_pipe_a_device_and_a_socket_are_no_files(tmp_path: Path):
    pipe, link = tmp_path / "pipe", tmp_path / "link"
    os.mkfifo(pipe)
    link.symlink_to(os.devnull)
    assert "pipe: is a named pipe, not a file" in str(path_fault(pipe))
    assert "link: is a device" in str(path_fault(link))
    (tmp_path / "file").touch()
    assert [path_fault(tmp_path / name) for name in ("file", "missing", ".")] == [None] * 3


def test_a_letter_in_another_encoding_is_told_from_bytes_of_no_text():
    said = foreign_letter("eins\nzwei\nfür drei".encode("latin-1"))
    assert said == "line 3: a letter that is not in UTF-8, 'ü' if it is in Windows-1252; save the file in UTF-8"
    assert foreign_letter("für".encode()) is None
    assert foreign_letter("für".encode("utf-16")) is None
    assert foreign_letter(bytes(range(256))) is None
