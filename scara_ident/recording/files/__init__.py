"""Files of recordings, each by its suffix: what columns they have, and their numbers.

Every reader yields named columns of one length, as `scara_ident.recording.files.parquet_csv` does for Parquet and CSV; what the columns
mean is for the robot description to say. A reader is loaded when a file of its kind is read.
"""

from __future__ import annotations

from collections.abc import Sequence
from importlib import import_module
from pathlib import Path
from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from scara_ident.errors import RecordingError

READERS = {
    ".parquet": "scara_ident.recording.files.parquet_csv",
    ".csv": "scara_ident.recording.files.parquet_csv",
    ".mat": "scara_ident.recording.files.mat",
    ".h5": "scara_ident.recording.files.hdf5",
    ".hdf5": "scara_ident.recording.files.hdf5",
    ".mcap": "scara_ident.recording.files.rosbag",
    ".db3": "scara_ident.recording.files.rosbag",
    ".bag": "scara_ident.recording.files.rosbag",
}
"""The module that reads files of each suffix."""

BAG = "scara_ident.recording.files.rosbag"
# The clock of PlotJuggler's CSV, which has a row for every time at which any of its signals has a sample.
SHARED_CLOCK = "__time"


def column_names(path: Path, topic: str | None = None) -> tuple[str, ...]:
    """List the columns of a file.

    Parameters
    ----------
    path : Path
        A file with a suffix of `READERS`, or the folder of a rosbag2 recording.
    topic : str, optional
        Topic of a bag; needed where it has several of joint states. Other files have none.

    Raises
    ------
    RecordingError
        In one line: the file, what is wrong with it, and what to do.
    """
    module = _module(path)
    if module.__name__ == BAG:
        names: tuple[str, ...] = module.column_names(path, topic)
    else:
        names = module.column_names(path)
    return names


def read_columns(path: Path, names: Sequence[str], topic: str | None = None) -> dict[str, NDArray[np.float64]]:
    """Read some columns of a file as float64, NaN where it has no value; all have one length.

    Raises
    ------
    RecordingError
        In one line: the file, the column and what to do.
    """
    module = _module(path)
    if module.__name__ == BAG:
        columns: dict[str, NDArray[np.float64]] = module.read_columns(path, names, topic)
    else:
        columns = module.read_columns(path, names)
    _refuse_lengths(path, columns)
    return columns


def is_recording(path: Path) -> bool:
    """Tell whether a path is one recording: a file of a known suffix, or the folder of a rosbag2 recording."""
    if path.is_dir():
        return is_bag_folder(path)
    return path.suffix.lower() in READERS


def is_bag_folder(path: Path) -> bool:
    """Tell whether a folder is one rosbag2 recording."""
    return (path / "metadata.yaml").is_file()


def shares_clock(path: Path, time: str) -> bool:
    """Tell whether a file has rows that belong to other signals than the wanted ones, which are then empty."""
    return time == SHARED_CLOCK or path.is_dir() or READERS.get(path.suffix.lower()) == BAG


def _module(path: Path) -> ModuleType:
    if is_bag_folder(path):
        return import_module(BAG)
    name = READERS.get(path.suffix.lower())
    if name is None:
        *most, last = READERS
        raise RecordingError(
            f"{path}: suffix {path.suffix!r} is not known; a recording is a {', '.join(most)} or {last} file, "
            "or the folder of a rosbag2 recording"
        )
    return import_module(name)


def _refuse_lengths(path: Path, columns: dict[str, NDArray[np.float64]]) -> None:
    sizes = {name: len(values) for name, values in columns.items()}
    if len(set(sizes.values())) <= 1:
        return
    first, size = next(iter(sizes.items()))
    other, length = next((name, n) for name, n in sizes.items() if n != size)
    raise RecordingError(
        f"{path}: {first!r} has {size} samples and {other!r} {length}; map columns that were recorded together"
    )
