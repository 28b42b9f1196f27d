"""Which recordings a fleet's folder holds, and of which date each is."""

from __future__ import annotations

import builtins
import os
from contextlib import ExitStack
from datetime import UTC, datetime
from pathlib import Path

import pytest

from scara_ident.errors import RecordingError, UsageError
from scara_ident.fleet.folder import RecordingFile, content_key, date_notes, date_of, fetched, file_system, list_fleet


@pytest.mark.parametrize(
    ("place", "date"),
    [
        ("2026-03-01/OJD_1.parquet", "2026-03-01"),
        ("2026-03-01/sub/OJD_1.parquet", "2026-03-01"),
        ("2026-03-01/OJD_2026-03-02_1.parquet", "2026-03-02"),
        ("OJD_20260315_1.csv", "2026-03-15"),
        ("2026-13-01/OJD_1.csv", "1970-01-02"),
        ("123456789/OJD_1.csv", "1970-01-02"),
    ],
)
def test_the_date_is_the_files_else_its_folders_else_that_of_writing(place, date):
    assert date_of(place, {"mtime": 86400.0}) == date


def test_a_date_that_does_not_exist_is_said_once_with_the_date_taken():
    def notes(*places: str) -> tuple[str, ...]:
        return date_notes([RecordingFile("arm2", date_of(place, {"mtime": 86400.0}), place, "") for place in places])

    assert notes("2026-02-30/OJD_1.csv", "2026-02-30/OJD_2.csv", "2026-02-28/OJD_1.csv") == (
        "arm2/2026-02-30/OJD_1.csv and 1 more: there is no date 2026-02-30; 1970-01-02 is taken, when the file was written; "
        "rename to the right date",
    )
    (said,) = notes("2026-03-01/OJD_2026-02-30_1.csv")
    assert "there is no date 2026-02-30; 2026-03-01 is taken, which is in the path too" in said
    assert len(notes("run_20260230_1.csv")) == 1
    assert "there is no date 2026-13-45" in notes("2026-13-45/OJD_1.csv")[0]
    # The date taken is the file's own, and digits in a row beside one are any number.
    assert notes("2026-02-30/OJD_2026-03-02_1.csv", "2026-03-01/serial_20011945_1.csv", "OJD_1.csv") == ()


def test_an_object_store_says_when_a_file_was_written():
    assert date_of("run_1.csv", {"LastModified": datetime(2026, 5, 4, tzinfo=UTC)}) == "2026-05-04"


def test_what_is_no_recording_is_left_out_and_an_arm_without_any_is_a_fault(tmp_path: Path):
    for place in (
        "b/2026-01-01/x_1.csv",
        "a/2026-01-02_1.parquet",
        "a/.hidden.csv",
        "a/.trash/x.csv",
        "a/notes.txt",
        "c/x.md",
    ):
        (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / place).write_text("x")
    (tmp_path / "robot.yaml").write_text("x")
    files, faults = list_fleet(str(tmp_path))
    assert [(file.arm, file.date, file.place) for file in files] == [
        ("a", "2026-01-02", "2026-01-02_1.parquet"),
        ("b", "2026-01-01", "2026-01-01/x_1.csv"),
    ]
    assert [str(fault) for fault in faults] == ["c: no recording in this arm's folder"]


def test_a_folder_that_is_none_or_has_no_arms_is_refused(tmp_path: Path):
    with pytest.raises(UsageError, match="no such folder"):
        list_fleet(str(tmp_path / "none"))
    with pytest.raises(RecordingError, match="one for each arm"):
        list_fleet(str(tmp_path))
    with pytest.raises(UsageError, match="s3://bucket/fleet"):
        list_fleet("nowhere://bucket")


def test_without_fsspec_one_line_says_what_to_install(monkeypatch):
    real = builtins.__import__

    def absent(name, *rest):
        if name.partition(".")[0] == "fsspec":
            raise ImportError("No module named 'fsspec'")
        return real(name, *rest)

    monkeypatch.setattr(builtins, "__import__", absent)
    with pytest.raises(UsageError, match=r'pip install "scara-ident\[fleet\]"'):
        file_system("fleet")


def test_a_key_is_that_of_the_content(tmp_path: Path):
    for name, text in (("a", "one"), ("b", "one"), ("c", "two")):
        (tmp_path / name).write_text(text)
    os.utime(tmp_path / "b", (0, 0))
    keys = [content_key(str(tmp_path / name)) for name in "abc"]
    assert keys[0] == keys[1] != keys[2]
    with pytest.raises(OSError):
        content_key(str(tmp_path / "none"))
    with ExitStack() as copies:
        assert fetched(str(tmp_path / "a"), copies) == tmp_path / "a"


def test_a_store_that_does_not_answer_is_one_line(monkeypatch: pytest.MonkeyPatch):
    """Without keys it was an internal error, to be reported."""

    class NoCredentialsError(Exception):
        pass

    class Store:
        def invalidate_cache(self) -> None:
            pass

        def isdir(self, root: str) -> bool:
            raise NoCredentialsError("Unable to locate\ncredentials")

    monkeypatch.setattr("scara_ident.fleet.folder.file_system", lambda _: (Store(), "bucket"))
    with pytest.raises(
        UsageError, match=r"^s3://bucket: cannot be read \(NoCredentialsError: Unable to locate credentials\)"
    ):
        list_fleet("s3://bucket")
