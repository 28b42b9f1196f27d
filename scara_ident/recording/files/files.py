"""What every reader asks of a file first, and how it says that a file is damaged or a library absent."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError
from scara_ident.files import path_fault


def check_file(path: Path) -> None:
    """Refuse what is no file, is missing, may not be read or is empty, or whose name no result can hold."""
    if (fault := path_fault(path)) is not None:
        raise RecordingError(fault)
    try:
        with path.open("rb") as file:
            if not file.read(1):
                raise RecordingError(f"{path}: the file is empty; record it again")
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {(error.strerror or str(error)).lower()}") from error


def optional_module(name: str, extra: str, path: Path) -> Any:
    """Import a library that is installed only where its format is needed."""
    try:
        return import_module(name)
    except ImportError:
        library = name.partition(".")[0]
        raise RecordingError(
            f'{path}: reading it needs the library {library}; install it with pip install "scara-ident[{extra}]"'
        ) from None


def damaged(path: Path, kind: str, error: BaseException) -> RecordingError:
    """Return the error that says that a file is not whole."""
    reason = " ".join(str(error).split()) or type(error).__name__
    return RecordingError(f"{path}: not a whole {kind} file ({reason[:200]}); copy or record it again")


def refuse_no_numbers(path: Path, what: str) -> None:
    """Refuse a file without a column of numbers."""
    raise RecordingError(f"{path}: no column of numbers in it; {what}")


def chosen(path: Path, found: Mapping[str, Array], names: Sequence[str]) -> dict[str, Array]:
    """Return columns in the order asked for.

    Raises
    ------
    RecordingError
        One was not found.
    """
    for name in names:
        if name not in found:
            raise absent(path, name)
    return {name: found[name] for name in names}


def absent(path: Path, name: str) -> RecordingError:
    """Return the error that a column is not in a file."""
    return RecordingError(f"{path}: no column {name!r}; list its columns with: scara-ident inspect {path}")
