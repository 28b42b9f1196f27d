"""Files of recordings, each by its suffix: what columns they have, and their numbers.

Every importer yields named columns of one length, as `scara_ident.recording.files.parquet_csv` does for Parquet and
CSV; what the columns mean is for the robot description to say. It is loaded when a file of its kind is read.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError
from scara_ident.registry import Registry


class Importer(Protocol):
    """A module, or an object, that reads files of one kind."""

    def column_names(self, path: Path) -> Sequence[str]:
        """List the columns of a file; raise `RecordingError` where it cannot be read."""
        ...

    def read_columns(self, path: Path, names: Sequence[str]) -> Mapping[str, Array]:
        """Read some columns, NaN where the file has no value; raise `RecordingError` where a column is absent."""
        ...


BAG = "scara_ident.recording.files.rosbag"
_BUILT_IN = {
    ".parquet": "scara_ident.recording.files.parquet_csv",
    ".csv": "scara_ident.recording.files.parquet_csv",
    ".mat": "scara_ident.recording.files.mat",
    ".npz": "scara_ident.recording.files.npz",
    ".h5": "scara_ident.recording.files.hdf5",
    ".hdf5": "scara_ident.recording.files.hdf5",
    ".mcap": BAG,
    ".db3": BAG,
    ".bag": BAG,
}
IMPORTERS: Registry[Importer] = Registry("suffix", "scara_ident.importers", _BUILT_IN)
"""What reads files, by their suffix: ``".csv"``."""

# What tables of text are also called; beside recordings these are often something else, so that a folder's are none.
_TEXT = (".txt", ".dat", ".tsv", ".asc", ".log")
# The clock of PlotJuggler's CSV, which has a row for every time at which any of its signals has a sample.
SHARED_CLOCK = "__time"


def column_names(path: Path, topic: str | None = None) -> tuple[str, ...]:
    """List the columns of a file.

    Parameters
    ----------
    path : Path
        A file with a suffix of `IMPORTERS`, or the folder of a rosbag2 recording.
    topic : str, optional
        Topic of a bag; needed where it has several of joint states. Other files have none.

    Raises
    ------
    RecordingError
        In one line: the file, what is wrong with it, and what to do.
    """
    if _is_bag(path):
        from scara_ident.recording.files import rosbag

        return rosbag.column_names(path, topic)
    return tuple(_importer(path).column_names(path))


def read_columns(path: Path, names: Sequence[str], topic: str | None = None) -> dict[str, Array]:
    """Read some columns of a file as float64, NaN where it has no value; all have one length.

    Raises
    ------
    RecordingError
        In one line: the file, the column and what to do.
    """
    if _is_bag(path):
        from scara_ident.recording.files import rosbag

        return rosbag.read_columns(path, names, topic)
    found = _importer(path).read_columns(path, names)
    columns = {name: np.asarray(values, dtype=np.float64) for name, values in found.items()}
    _refuse_lengths(path, columns)
    return columns


def is_recording(path: Path) -> bool:
    """Tell whether a path is one recording: a file of a known suffix, or the folder of a rosbag2 recording."""
    if path.is_dir():
        return is_bag_folder(path)
    return path.suffix.lower() in IMPORTERS.names()


def is_bag_folder(path: Path) -> bool:
    """Tell whether a folder is one rosbag2 recording."""
    return (path / "metadata.yaml").is_file()


def shares_clock(path: Path, time: str) -> bool:
    """Tell whether a file has rows that belong to other signals than the wanted ones, which are then empty."""
    return time == SHARED_CLOCK or path.is_dir() or _is_bag(path)


def _is_bag(path: Path) -> bool:
    return is_bag_folder(path) or _BUILT_IN.get(path.suffix.lower()) == BAG


def _importer(path: Path) -> Importer:
    suffix, known = path.suffix.lower(), IMPORTERS.names()
    if suffix not in known:
        *most, last = known
        hint = (
            f"; if it is a table of numbers rename it to {path.stem}.csv, whatever separates them"
            if suffix in _TEXT
            else ""
        )
        raise RecordingError(
            f"{path}: suffix {path.suffix!r} is not known; a recording is a {', '.join(most)} or {last} file, "
            f"or the folder of a rosbag2 recording{hint}"
        )
    return IMPORTERS.get(suffix)


def _refuse_lengths(path: Path, columns: dict[str, Array]) -> None:
    sizes = {name: len(values) for name, values in columns.items()}
    if len(set(sizes.values())) <= 1:
        return
    first, size = next(iter(sizes.items()))
    other, length = next((name, n) for name, n in sizes.items() if n != size)
    raise RecordingError(
        f"{path}: {first!r} has {size} samples and {other!r} {length}; map columns that were recorded together"
    )
