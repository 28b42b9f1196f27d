"""A folder of a fleet: a sub-folder for each arm, and in it recordings with their dates."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from datetime import UTC, date, datetime
from hashlib import blake2b
from pathlib import Path, PurePosixPath
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from scara_ident.errors import RecordingError, UsageError
from scara_ident.recording.files import IMPORTERS

if TYPE_CHECKING:
    from fsspec import AbstractFileSystem

INSTALL = 'install it with: pip install "scara-ident[fleet]"'
# With hyphens it is meant as one whatever its month and day; digits in a row may be any number.
_DATE = re.compile(r"(?<![0-9])((?:19|20)[0-9]{2})(?:-([0-9]{2})-([0-9]{2})|-?([01][0-9])-?([0-3][0-9]))(?![0-9])")


@dataclass(frozen=True, order=True)
class RecordingFile:
    """A recording of an arm.

    Attributes
    ----------
    arm : str
        Name of the arm's folder.
    date : str
        ISO date: of the file's name, else of the nearest folder above it, else on which the file was written (UTC).
    place : str
        Path within the arm's folder.
    url : str
        Where it is, for `fsspec`.
    """

    arm: str
    date: str
    place: str
    url: str


@dataclass(frozen=True)
class Fault:
    """What could not be used, and why, in one line.

    Attributes
    ----------
    arm : str
    date : str or None
    file : str or None
        Path within the arm's folder; None where it is no single file.
    why : str
    passing : bool
        Whether it may be another time that it can, as when a file could not be opened.
    """

    arm: str
    date: str | None
    file: str | None
    why: str
    passing: bool = False

    def __str__(self) -> str:
        return self.why if self.file is None else f"{self.arm}/{self.file}: {self.why}"


def file_system(folder: str) -> tuple[AbstractFileSystem, str]:
    """Return the file system of a folder and its path there.

    Parameters
    ----------
    folder : str
        A path, or an address that fsspec knows, as ``s3://bucket/fleet``.

    Raises
    ------
    UsageError
        If it has no such scheme, or the library for it is not installed.
    """
    try:
        from fsspec.core import url_to_fs

        fs, path = url_to_fs(folder)
    except ImportError as error:
        raise UsageError(f"{folder}: reading it needs a library ({error}); {INSTALL}") from None
    except ValueError as error:
        raise UsageError(f"{folder}: {error}; give a folder or an address such as s3://bucket/fleet") from None
    return fs, str(path)


def list_fleet(folder: str) -> tuple[tuple[RecordingFile, ...], tuple[Fault, ...]]:
    """List the recordings of a fleet, by arm, date and place.

    Files that are no recordings by their suffix, and those whose names begin with a dot, are left out.

    Returns
    -------
    files : tuple of RecordingFile
    faults : tuple of Fault
        Arms without a recording.

    Raises
    ------
    UsageError
        If there is no such folder.
    RecordingError
        If it has no sub-folder.
    """
    fs, root = file_system(folder)
    with suppress(FileNotFoundError):
        fs.invalidate_cache()
    try:
        there = fs.isdir(root)
    except OSError:
        raise
    except Exception as error:
        # The library of each store has errors of its own, such as for keys that are not there.
        said = " ".join(str(error).split())
        raise UsageError(f"{folder}: cannot be read ({type(error).__name__}: {said}); check address and keys") from None
    if not there:
        raise UsageError(f"{folder}: no such folder")
    arms = sorted(item["name"].rstrip("/") for item in fs.ls(root, detail=True) if item["type"] == "directory")
    arms = [path for path in arms if not PurePosixPath(path).name.startswith(".")]
    if not arms:
        raise RecordingError(f"{folder}: no folder in it; a fleet's folder has one for each arm")
    files: list[RecordingFile] = []
    faults: list[Fault] = []
    for path in arms:
        arm = PurePosixPath(path).name
        found: Mapping[str, Mapping[str, Any]] = fs.find(path, detail=True)
        own = [(place, info) for place, info in found.items() if _is_recording(place, path)]
        for place, info in own:
            inner = PurePosixPath(place).relative_to(path).as_posix()
            files.append(RecordingFile(arm, date_of(inner, info), inner, fs.unstrip_protocol(place)))
        if not own:
            faults.append(Fault(arm, None, None, f"{arm}: no recording in this arm's folder"))
    return tuple(sorted(files)), tuple(faults)


def date_of(place: str, info: Mapping[str, Any]) -> str:
    """Return the date of a recording, see `RecordingFile`.

    Examples
    --------
    >>> date_of("2026-03-01/OJD_1.parquet", {})
    '2026-03-01'
    >>> date_of("2026-03/run_20260315_2.csv", {})
    '2026-03-15'
    """
    for _, named in _named_dates(place):
        if named is not None:
            return named
    written = info.get("LastModified") or info.get("mtime") or info.get("updated") or 0.0
    if not isinstance(written, datetime):
        with suppress(TypeError, ValueError):
            return datetime.fromtimestamp(float(written), UTC).date().isoformat()
        written = datetime.fromisoformat(str(written))
    return written.date().isoformat()


def date_notes(files: Sequence[RecordingFile]) -> tuple[str, ...]:
    """Say which recordings are named after a date that does not exist, and which date they have instead.

    Parameters
    ----------
    files : sequence of RecordingFile

    Returns
    -------
    tuple of str
        One for all recordings of an arm with one such date.
    """
    found: dict[tuple[str, str, bool], list[RecordingFile]] = {}
    for file in files:
        named = list(_named_dates(file.place))
        real = [day for _, day in named if day is not None]
        for word, day in named:
            if day is not None:
                break
            # Digits in a row may be any number where a date is named beside them.
            if "-" in word or not real:
                found.setdefault((file.arm, word, bool(real)), []).append(file)
                break
    return tuple(
        f"{arm}/{same[0].place}{f' and {len(same) - 1} more' if same[1:] else ''}: there is no date {word}; "
        f"{same[0].date} is taken, {'which is in the path too' if real else 'when the file was written'}; rename to the right date"
        for (arm, word, real), same in found.items()
    )


def _named_dates(place: str) -> Iterator[tuple[str, str | None]]:
    """Give what looks like a date in a path, the nearest to its end first, with the ISO date; None where there is no such."""
    for part in reversed(PurePosixPath(place).parts):
        for match in reversed(list(_DATE.finditer(part))):
            try:
                yield match[0], date(*(int(part) for part in match.groups() if part is not None)).isoformat()
            except ValueError:
                yield match[0], None


def content_key(url: str) -> str:
    """Return a key of a file's content: its hash, or for an object store what that says of it without reading it.

    Raises
    ------
    OSError
        If it is not there or may not be read.
    """
    fs, path = file_system(url)
    if _is_local(fs):
        with open(path, "rb") as file:
            # Broken links and folders fail here as they would when they are read.
            digest = blake2b(digest_size=16)
            while part := file.read(1 << 20):
                digest.update(part)
        return digest.hexdigest()
    return f"{fs.checksum(path)}-{fs.size(path)}"


def fetched(url: str, copies: ExitStack) -> Path:
    """Return a file as one on this machine's disk; what is elsewhere is copied, and the copy goes with the stack.

    Raises
    ------
    OSError
        If it cannot be had.
    """
    fs, path = file_system(url)
    if _is_local(fs):
        return Path(path)
    # A folder of its own: files of several places may have one name.
    copy = Path(copies.enter_context(TemporaryDirectory())) / PurePosixPath(path).name
    fs.get_file(path, str(copy))
    return copy


def _is_local(fs: AbstractFileSystem) -> bool:
    return "file" in ((fs.protocol,) if isinstance(fs.protocol, str) else fs.protocol)


def _is_recording(place: str, arm: str) -> bool:
    inner = PurePosixPath(place).relative_to(arm)
    hidden = any(part.startswith(".") for part in inner.parts)
    return not hidden and inner.suffix.lower() in IMPORTERS.names()
