"""Reading files in another process of a command, so that one that crashes what reads it is named."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache, partial
from itertools import chain
from pathlib import Path
from typing import TypeAlias, TypeVar

from scara_ident.errors import ProcessEnded, RecordingError
from scara_ident.processes import each_beside
from scara_ident.recording.paths import recording_paths
from scara_ident.recording.recording import Recording, distinctly_named, read_recording
from scara_ident.robot.robot import Robot

T = TypeVar("T")
Words: TypeAlias = Sequence[Path | str]
# Recordings that can be used, and what is to be said of the others.
Usable: TypeAlias = tuple[tuple[Recording, ...], list[str]]


@contextmanager
def usable_beside(robot: Robot, *each: Words) -> Iterator[Callable[[], list[Usable]]]:
    """Read recordings with effort meanwhile; yields what waits for those of each that can be used, and what is said of the others.

    Parameters
    ----------
    *each : sequence of path or str
        See `read_recordings`. A file that several name is read once.

    Raises
    ------
    UsageError, RecordingError
        As `read_recordings`; that of the first recording of one of them where none can be used.
    """
    named = [recording_paths(words) for words in each]
    paths = list(dict.fromkeys(chain(*named)))
    with _each_apart(lambda path: read_recording(path, robot), paths) as wanted:

        def found() -> list[Usable]:
            read = dict(zip(paths, wanted(), strict=True))
            return [_usable([read[path] for path in group]) for group in named]

        yield found


def read_usable(words: Words, robot: Robot) -> Usable:
    """Read recordings with effort, without those that cannot be used, and say which, see `usable_beside`."""
    with usable_beside(robot, words) as wanted:
        (found,) = wanted()
        return found


def read_apart(read: Callable[[Path], T], path: Path) -> T:
    """Return what is read of one file.

    Raises
    ------
    RecordingError
        The file crashes what reads it.
    """
    with _each_apart(read, [path]) as wanted:
        (found,) = wanted()
        return found()


def _usable(each: Sequence[Callable[[], Recording]]) -> Usable:
    found, notes, errors = [], [], []
    for read in each:
        try:
            found.append(read())
        except RecordingError as error:
            errors.append(error)
            notes.append(f"{error}; left out")
    if errors and not found:
        raise errors[0]
    return distinctly_named(found), notes


@contextmanager
def _each_apart(read: Callable[[Path], T], paths: Sequence[Path]) -> Iterator[Callable[[], list[Callable[[], T]]]]:
    """Read files meanwhile; yields what waits for what gives each, or raises its error."""

    def or_crash(path: Path, found: Callable[[], T]) -> T:
        try:
            return found()
        except ProcessEnded:
            raise RecordingError(
                f"{path}: reading it crashes, for example because the file is damaged or too large for the memory; save it again"
            ) from None

    # Polars in a process that is forked from one that used it waits for threads that are not there.
    if "polars" in sys.modules:
        yield lambda: [cache(partial(read, path)) for path in paths]
        return
    with each_beside(read, paths) as results:
        yield lambda: [partial(or_crash, path, found) for path, found in zip(paths, results(), strict=True)]
