"""Results on disk, written whole or not at all, and checks of what can be read from."""

from __future__ import annotations

import errno
import json
import os
import platform
import re
import secrets
import shutil
import stat
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import cache
from hashlib import blake2s
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident.errors import ScaraIdentError, UsageError

# A small result file needs about so much; where this does not fit, no result does.
PROBE = 4096
# Bytes of a name out of a file; file systems take 255 with what is put before and behind it.
LONGEST_SLUG = 200
# What is still being written: whose it is, so that what a killed run has left can be distinguished from what another run writes.
UNFINISHED = ".scara-ident"
# Bytes of no text in an encoding of one byte a letter, but tabs and ends of lines; UTF-16 has a 0 in every other byte.
_NO_TEXT = re.compile(rb"[\x00-\x08\x0e-\x1f]")
_KINDS = (
    (stat.S_ISFIFO, "a named pipe"),
    (stat.S_ISCHR, "a device"),
    (stat.S_ISBLK, "a device"),
    (stat.S_ISSOCK, "a socket"),
)


def path_fault(path: Path | str) -> str | None:
    """Say why a path can be no file's, or none that a result can name; None where it can.

    A pipe has no end, nor has a device.

    Parameters
    ----------
    path : path
        Links are followed; what is missing or a folder is for the reader to say.

    Returns
    -------
    str or None
        The path so that it can be printed, and what to do.
    """
    text = str(path)
    shown = text.encode("utf-8", errors="replace").decode("utf-8").replace("\0", "?")
    if "\0" in text:
        return f"{shown}: has a null byte in its name; correct the name"
    try:
        text.encode("utf-8")
    except UnicodeEncodeError:
        return f"{shown}: its name is not text in UTF-8; rename it"
    with suppress(OSError, ValueError):
        mode = Path(path).stat().st_mode
        kind = next((name for is_it, name in _KINDS if is_it(mode)), None)
        return None if kind is None else f"{shown}: is {kind}, not a file; save it as a file first"
    return None


def unreadable(path: Path, error: OSError, instead: str) -> ScaraIdentError:
    """Return the error that says why a file that was given cannot be read: bad usage where there is none.

    Parameters
    ----------
    instead : str
        What to give.
    """
    if isinstance(error, FileNotFoundError | NotADirectoryError):
        return UsageError(f"{path}: no such file; {instead}")
    return ScaraIdentError(f"{path}: cannot be read: {error.strerror or error}; {instead}")


def real_path(path: Path) -> Path:
    """Return the path behind links, absolute; of links that go round in a ring, the path as it is."""
    try:
        return Path(os.path.realpath(path))
    except ValueError:
        return path


def slug(name: str, default: str) -> str:
    """Return a name out of a file as the name of a file: it leads into no folder, whatever it holds.

    Parameters
    ----------
    name : str
        Letters, digits, blanks and ``. _ + -`` inside it stay, anything else becomes ``-``.
    default : str
        Where nothing is left of it.

    Returns
    -------
    str
        At most `LONGEST_SLUG` bytes; it begins with no point.

    Examples
    --------
    >>> slug("../../arm 1", "robot")
    'arm 1'
    >>> slug("/", "robot")
    'robot'
    """
    kept = re.sub(r"[^\w .+-]+", "-", name).strip("-. ")
    return kept.encode("utf-8")[:LONGEST_SLUG].decode("utf-8", errors="ignore").strip("-. ") or default


def check_output(folder: Path | None) -> None:
    """Refuse a folder that results cannot be written into, before the work that they come from.

    Parameters
    ----------
    folder : Path or None
        It may be still to be made, and is as it was afterwards. None is no output and always right.

    Raises
    ------
    ScaraIdentError
        In one line: it cannot be made or not be written into, or the disk is full.
    """
    if folder is None:
        return
    if (fault := path_fault(folder)) is not None:
        raise UsageError(fault)
    made: list[Path] = []
    try:
        made = _make(folder)
        _sweep(folder)
        with tempfile.TemporaryFile(dir=folder) as probe:
            probe.write(bytes(PROBE))
    except OSError as error:
        raise _refused(folder, error) from None
    finally:
        _unmake(made)


@contextmanager
def written_together(folder: Path) -> Iterator[Path]:
    """Write several results whole or not at all.

    Parameters
    ----------
    folder : Path
        Where they are to stand; made if needed.

    Yields
    ------
    Path
        A folder to write them into. Its files move into `folder` together when the block ends; where it ends in an
        error, `folder` is as it was before.

    Raises
    ------
    ScaraIdentError
        In one line, if they cannot be written.
    """
    made: list[Path] = []
    stage: Path | None = None
    try:
        made = _make(folder)
        # Its name is known before it is there, so that no signal comes between.
        stage = _unfinished(folder)
        stage.mkdir(mode=0o700)
        yield stage
        files = sorted(stage.iterdir())
        for file in files:
            if (folder / file.name).is_dir():
                raise ScaraIdentError(f"{folder / file.name}: cannot be written: a folder has this name; move it away")
        for file in files:
            os.replace(file, folder / file.name)
    except OSError as error:
        raise _refused(folder, error) from None
    except ScaraIdentError as error:
        if stage is None or str(stage) not in str(error):
            raise
        # The place where the file was to stand, not the one where it waited.
        raise ScaraIdentError(str(error).replace(str(stage), str(folder))) from None
    finally:
        if stage is not None:
            shutil.rmtree(stage, ignore_errors=True)
        _unmake(made)


def _make(folder: Path) -> list[Path]:
    """Make a folder and those above it; return what was made, the deepest first."""
    missing = []
    for place in (folder, *folder.parents):
        if place.exists():
            break
        missing.append(place)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        _unmake(missing)
        raise
    return missing


def _unmake(made: list[Path]) -> None:
    """Remove folders that are still empty."""
    for place in made:
        with suppress(OSError):
            place.rmdir()


def _refused(folder: Path, error: OSError) -> ScaraIdentError:
    return ScaraIdentError(f"{folder}: results cannot be written here: {why_unwritten(error)}")


def why_unwritten(error: Exception) -> str:
    """Say why something cannot be written, and what to do.

    Parameters
    ----------
    error : Exception
        Of the system, or of a library that only has the system's words.

    Returns
    -------
    str
        The end of a line.
    """
    number, what = getattr(error, "errno", None), getattr(error, "strerror", None) or str(error).partition("\n")[0]
    if isinstance(error, FileExistsError | NotADirectoryError):
        return "is a file; give another folder"
    if number in (errno.ENOSPC, errno.EDQUOT) or (number is None and os.strerror(errno.ENOSPC) in what):
        return f"{os.strerror(number or errno.ENOSPC)}; make room or give another folder"
    return f"{what}; give another folder"


def write_whole(path: Path, write: Callable[[Path], None]) -> None:
    """Write a file under a temporary name beside it and move it into place when it is complete.

    Parameters
    ----------
    path : Path
        Its folder is made if needed.
    write : callable
        Called with the temporary path, which has the same suffix.

    Raises
    ------
    ScaraIdentError
        In one line, if it cannot be written; nothing is left behind.
    """
    made: list[Path] = []
    try:
        made = _make(path.parent)
        with replacing(path) as temporary:
            write(temporary)
    except OSError as error:
        raise ScaraIdentError(f"{path}: cannot be written: {why_unwritten(error)}") from None
    finally:
        _unmake(made)


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a name of the same suffix beside a file; what is written there becomes the file when the block ends well."""
    temporary = _unfinished(path.parent, path.suffix)
    try:
        temporary.touch(exist_ok=False)
        yield temporary
        temporary.chmod(0o644)
        os.replace(temporary, path)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def _unfinished(folder: Path, suffix: str = "") -> Path:
    return folder / f"{UNFINISHED}-{_here()}-{os.getpid()}-{secrets.token_hex(4)}{suffix}"


@cache
def _here() -> str:
    """Name where process numbers count: this machine, and its container."""
    try:
        space = os.stat("/proc/self/ns/pid").st_ino
    except OSError:
        space = 0
    return blake2s(f"{platform.node()} {space}".encode(), digest_size=4).hexdigest()


def _sweep(folder: Path) -> None:
    """Remove what a killed run of this machine has left in a folder."""
    ours = re.compile(rf"{re.escape(UNFINISHED)}-{_here()}-([0-9]{{1,10}})-[0-9a-f]{{8}}(\.\w+)?")
    with suppress(OSError):
        for left in folder.iterdir():
            match = ours.fullmatch(left.name)
            if match is None or _runs(int(match[1])):
                continue
            if left.is_dir() and not left.is_symlink():
                shutil.rmtree(left, ignore_errors=True)
            else:
                left.unlink(missing_ok=True)


def _runs(process: int) -> bool:
    try:
        os.kill(process, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except OSError:
        return True
    return True


def write_json(path: Path, content: dict[str, Any]) -> None:
    """Write a result as JSON; numbers that JSON does not know become null."""
    write_text(path, json_text(content) + "\n")


def json_text(content: dict[str, Any]) -> str:
    """Return a result as JSON; numbers that JSON does not know become null."""
    return json.dumps(plain(content), indent=1, allow_nan=False)


def write_text(path: Path, text: str) -> None:
    """Write a text file whole or not at all."""

    def write(temporary: Path) -> None:
        temporary.write_text(text, encoding="utf-8")

    write_whole(path, write)


def plain(value: Any) -> Any:
    """Return a value made of what JSON knows: NumPy numbers as Python's, infinities and NaN as None."""
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if np.isfinite(value) else None
    return value


def foreign_letter(content: bytes) -> str | None:
    """Say which letter of a text is in another encoding than UTF-8, in which line, and what to do; None where there is none.

    None too of bytes that no text has, as of UTF-16 or a compressed file.
    """
    try:
        content.decode("utf-8")
    except UnicodeDecodeError as error:
        letter = content[error.start : error.start + 1].decode("cp1252", errors="ignore")
        if letter and not _NO_TEXT.search(content):
            line = content.count(b"\n", 0, error.start) + 1
            return f"line {line}: a letter that is not in UTF-8, {letter!r} if it is in Windows-1252; save the file in UTF-8"
    return None
