"""Reading recordings in another process: while the rest is loaded, and so that a file which crashes its reader is named."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias, TypeVar

from scara_ident.errors import ProcessEnded, RecordingError, ScaraIdentError

if TYPE_CHECKING:
    from scara_ident.recording.recording import Recording
    from scara_ident.robot.robot import Robot

T = TypeVar("T")
Words: TypeAlias = Sequence[Path | str]
# What `read_usable` returns.
Usable: TypeAlias = "tuple[tuple[Recording, ...], list[str]]"
# What all work on recordings loads sooner or later.
LATER = ("scipy.fft", "scipy.linalg", "scipy.special")
# Bytes of files that another process reads: what it read of more takes longer to be sent, and memory twice.
SMALL = 30e6


@contextmanager
def read_beside(arm: Robot, *each: Words) -> Iterator[Callable[[], list[Usable]]]:
    """Read recordings in another process while what works on them is loaded; yields what waits for them.

    Many or long ones are read here, when they are waited for. One that crashes what reads it is left out as any other that cannot
    be used.

    Parameters
    ----------
    *each : sequence of path or str
        Of each that names any, at least one has to be usable, see `read_usable`.
    """
    from scara_ident.recording.paths import recording_paths
    from scara_ident.recording.recording import read_usable

    def read() -> list[Usable]:
        return [read_usable(words, arm) for words in each]

    def without_crashes() -> list[Usable]:
        paths = [recording_paths(words) for words in each]
        crash = {path: _crash(path, arm) for path in chain(*paths)}
        for group in paths:
            errors = [error for path in group if (error := crash[path]) is not None]
            if errors and len(errors) == len(group):
                raise errors[0]
        # Where it was no file, a second time may go well, and else says why not.
        left = _in_another(
            lambda: [read_usable([path for path in group if crash[path] is None], arm) for group in paths]
        )
        return [
            (found, [*notes, *(f"{crash[path]}; left out" for path in group if crash[path] is not None)])
            for (found, notes), group in zip(left, paths, strict=True)
        ]

    with _reading(read, list(chain(*map(recording_paths, each)))) as wanted:
        for name in LATER:
            import_module(name)

        def found() -> list[Usable]:
            try:
                return wanted()
            except ProcessEnded:
                return without_crashes()

        yield found


def read_apart(read: Callable[[], T], path: Path) -> T:
    """Return what is read of one file in another process; of a long one in this.

    Raises
    ------
    RecordingError
        The file crashes what reads it.
    """
    with _reading(read, [path]) as wanted:
        try:
            return wanted()
        except ProcessEnded:
            raise _crashes(path) from None


def _in_another(read: Callable[[], T]) -> T:
    """Return what is read in another process."""
    from scara_ident.processes import beside

    with beside(read) as told:
        return told()


@contextmanager
def _reading(read: Callable[[], T], paths: Sequence[Path]) -> Iterator[Callable[[], T]]:
    """Read in another process where that is possible and the files are small; yields what waits for it."""
    from scara_ident.processes import beside

    large = sum(path.stat().st_size for path in paths if path.is_file()) > SMALL
    # Polars in a process that is forked from one that used it waits for threads that are not there.
    if large or not paths or "polars" in sys.modules:
        yield read
        return
    with beside(read) as told:
        yield told


def _crash(path: Path, arm: Robot) -> RecordingError | None:
    """Return what is to be said of a recording that crashes what reads it; None of any other."""
    from scara_ident.recording.recording import read_recording

    try:
        _in_another(lambda: read_recording(path, arm))
    except ProcessEnded:
        return _crashes(path)
    except ScaraIdentError:
        return None
    return None


def _crashes(path: Path) -> RecordingError:
    return RecordingError(
        f"{path}: what reads it crashes, as on a file that is damaged or too large for the memory; save it again"
    )
