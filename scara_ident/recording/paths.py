"""Which files words on a command line stand for."""

from __future__ import annotations

import glob
import os
import re
from collections.abc import Sequence
from pathlib import Path
from shlex import quote

from scara_ident.errors import RecordingError, UsageError
from scara_ident.files import real_path
from scara_ident.recording.files import IMPORTERS, is_bag_folder, is_recording


def recording_name(path: Path) -> str:
    """Return the name of a recording: the stem of its file, or the name of its folder."""
    return real_path(path).name if path.is_dir() else path.stem


def recording_paths(words: Path | str | Sequence[Path | str]) -> tuple[Path, ...]:
    """List the files that words on a command line stand for (see `read_recordings`)."""
    words = (words,) if isinstance(words, (Path, str)) else words
    found: dict[Path, Path] = {}
    stems: dict[tuple[Path, str], Path] = {}
    for word in words:
        for path in _paths(str(word)):
            real = real_path(path)
            if real in found:
                continue
            named = real.parent, recording_name(path)
            if named in stems:
                raise RecordingError(
                    f"{stems[named]} and {path}: two recordings named {named[1]!r}; rename one, results are listed by name"
                )
            found[real] = stems[named] = path
    return tuple(found.values())


def distinct_names(paths: Sequence[Path]) -> tuple[str, ...]:
    """Return a name for each recording: its own, led by as many of its folders as tell it from others of that name.

    Examples
    --------
    >>> from pathlib import Path
    >>> distinct_names([Path("monday/run_1.csv"), Path("tuesday/run_1.csv"), Path("tuesday/run_2.csv")])
    ('monday/run_1', 'tuesday/run_1', 'run_2')
    """
    named = [(*Path(os.path.abspath(path)).parts[1:-1], recording_name(path)) for path in paths]
    alike: dict[str, list[tuple[str, ...]]] = {}
    for name in named:
        alike.setdefault(name[-1], []).append(name)
    return tuple("/".join(name[-_distinct_words(name, alike[name[-1]]) :]) for name in named)


def _distinct_words(name: tuple[str, ...], alike: Sequence[tuple[str, ...]]) -> int:
    """Return how many of the last words of a name no other of these ends in."""
    others = [other for other in alike if other != name]
    count = 1
    while any(other[-count:] == name[-count:] for other in others):
        count += 1
    return count


def _paths(word: str) -> list[Path]:
    path = Path(word)
    if path.is_dir() and not is_bag_folder(path):
        found = _in_folder(path)
        if not found:
            raise RecordingError(
                f"{path}: no .parquet or .csv file in this folder, nor another recording ({_others()}); {_within(path)}"
            )
        return found
    if path.exists():
        return [path]
    if not glob.has_magic(word) or path.is_symlink():
        raise UsageError(f"{word}: {'a link that leads to no file' if path.is_symlink() else 'no such file or folder'}")
    matches = [Path(match) for match in sorted(glob.glob(word, recursive=True), key=_natural)]
    if not matches:
        raise UsageError(f"{word}: no file matches")
    found = []
    for match in matches:
        found += [match] if is_recording(match) else _in_folder(match) if match.is_dir() else []
    if not found:
        raise RecordingError(f"{word}: matches {len(matches)} files but no .parquet or .csv file ({_others()})")
    return found


def _within(folder: Path) -> str:
    """Say how to name recordings in folders of a folder that has none itself."""
    inside = [each for each in folder.iterdir() if each.is_dir() and each.name[0] != "."]
    if not inside:
        return "name one that holds recordings"
    signs = "*" if any(map(_in_folder, inside)) else "**"
    word = quote(os.path.join(glob.escape(str(folder)), signs))
    return (
        f"folders inside are not searched: {word} takes the recordings of {'these' if signs == '*' else 'all of them'}"
    )


def _others() -> str:
    return ", ".join([*IMPORTERS.names()[2:], "rosbag2 folder"])


def _in_folder(folder: Path) -> list[Path]:
    files = [f for f in folder.iterdir() if is_recording(f) and f.name[0] != "."]
    return sorted(files, key=lambda file: _natural(file.name))


def _natural(text: str) -> list[tuple[int, str]]:
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"([0-9]+)", text)]
