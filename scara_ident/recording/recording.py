"""One run of one trajectory: reading, writing and gathering recordings."""

from __future__ import annotations

import glob
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError, UsageError
from scara_ident.files import real_path
from scara_ident.manners import Reported
from scara_ident.recording.audit import Finding, Samples, audit
from scara_ident.recording.columns import recording_columns
from scara_ident.recording.files import IMPORTERS, column_names, is_bag_folder, is_recording, read_columns, shares_clock
from scara_ident.recording.files.parquet_csv import write_columns
from scara_ident.recording.one_clock import on_one_clock
from scara_ident.recording.wanted import lacking_numbers, optional_channels, refuse_missing
from scara_ident.robot.signal_map import SIGNALS, Channel, Channels, contract_channels

if TYPE_CHECKING:
    from scara_ident.robot.robot import Robot


@dataclass(frozen=True, eq=False, repr=False)
class Recording(Reported, told_by="recording"):
    """One run of one trajectory.

    Attributes
    ----------
    name : str
        Stem of the file.
    trajectory : str
        The stem without a trailing ``_<number>``.
    repetition : int
        That number, 1 where the stem has none.
    joints : tuple of str
        The n joints, in the robot's order.
    time : ndarray, shape (N,)
        Time in s, strictly increasing.
    position : ndarray, shape (n, N)
        Joint positions in rad or m.
    effort : ndarray, shape (n, N), or None
        Torque in N m or force in N on the robot's effort side, after ``effort_gain``.
    velocity, acceleration : ndarray, shape (n, N), or None
        As recorded, in rad/s (m/s) and rad/s^2 (m/s^2); None where they are absent for any joint.
    temperature : ndarray, shape (n, N), or None
        In deg C.
    link_position : ndarray, shape (n, N), or None
        Of a second encoder behind the gear, in rad or m; NaN for a joint without one, None where there is none.
    findings : tuple of Finding
        What the audit saw in the file and did about it.
    path : Path or None
        The file that it was read from.

    Raises
    ------
    RecordingError
        If shapes disagree or time does not grow.
    """

    name: str
    trajectory: str
    repetition: int
    joints: tuple[str, ...]
    time: Array
    position: Array
    effort: Array | None = None
    velocity: Array | None = None
    acceleration: Array | None = None
    temperature: Array | None = None
    link_position: Array | None = None
    findings: tuple[Finding, ...] = ()
    path: Path | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        source = self.path or self.name
        shape = (len(self.joints), len(self.time))
        for name in SIGNALS:
            if (signal := getattr(self, name)) is not None and np.shape(signal) != shape:
                raise RecordingError(f"{source}: {name} has shape {np.shape(signal)}, joints and time ask for {shape}")
        if not np.all(np.diff(self.time) > 0):
            raise RecordingError(f"{source}: time is not strictly increasing")

    @property
    def rate(self) -> float:
        """Median sample rate, Hz."""
        return 1.0 / float(np.median(np.diff(self.time)))

    def _in_short(self) -> str:
        return f"{self.name}: {len(self.joints)} joints, {len(self.time)} samples at {self.rate:.4g} Hz"


def split_name(stem: str) -> tuple[str, int]:
    """Split the stem of a file into its trajectory and the number of its repetition.

    Examples
    --------
    >>> split_name("OJD_2")
    ('OJD', 2)
    >>> split_name("OJD")
    ('OJD', 1)
    """
    match = re.fullmatch(r"(.+)_([0-9]+)", stem, re.DOTALL)
    return (match[1], int(match[2])) if match else (stem, 1)


def recording_name(path: Path) -> str:
    """Return the name of a recording: the stem of its file, or the name of its folder."""
    return real_path(path).name if path.is_dir() else path.stem


def read_recording(path: Path | str, robot: Robot, *, need_effort: bool = True) -> Recording:
    """Read a recording and audit it.

    Parameters
    ----------
    path : path
        A file of a kind that `scara_ident.recording.files` knows by its suffix, or the folder of a rosbag2 recording.
    robot : Robot
        Says which joints are wanted, in which order, in which columns and units they stand, and what a recorded
        effort is worth.
    need_effort : bool
        Whether a file without efforts is refused. Where they are not needed, efforts are read if they are complete.

    Returns
    -------
    Recording

    Raises
    ------
    RecordingError
        In one line: the file, the column and row, and what to do.
    """
    path = Path(path)
    channels = robot.channels or contract_channels(robot.joints)
    shared = shares_clock(path, channels.time.column)
    names = column_names(path, channels.topic)

    def read(wanted: Sequence[str]) -> dict[str, Array]:
        return read_columns(path, wanted, channels.topic)

    found = recording_of(path, names, read, robot, channels, need_effort=need_effort, shared_clock=shared)
    return replace(found, path=path)


def recording_of(
    path: Path,
    names: Sequence[str],
    read: Callable[[Sequence[str]], dict[str, Array]],
    robot: Robot,
    channels: Channels,
    *,
    need_effort: bool = True,
    shared_clock: bool = False,
) -> Recording:
    """Make a recording of columns, wherever they are, and audit it.

    Parameters
    ----------
    path : Path
        Names the recording, also in errors.
    names : sequence of str
        Columns that there are.
    read : callable
        Returns some of them, each of shape (N,).
    robot : Robot
    channels : Channels
        Where the robot's signals stand.
    need_effort : bool
        See `read_recording`.
    shared_clock : bool
        Whether rows may hold only some of the channels.

    Raises
    ------
    RecordingError
        As `read_recording`.
    """
    needed = [channels.time, *channels.position, *(channels.effort if need_effort else ())]
    refuse_missing(path, names, [channel.column for channel in needed], channels)
    optional, findings = optional_channels(path, channels, names, () if need_effort else ("effort",))
    second = {k: place for k, place in enumerate(channels.link_position) if place.column in names}
    wanted = [channel.column for channel in (*needed, *chain.from_iterable(optional.values()), *second.values())]
    columns = read(wanted)
    if shared_clock:
        columns, joined = on_one_clock(columns, channels.time.column, [channel.column for channel in needed[1:]])
        findings += joined

    def rows(wanted: Sequence[Channel]) -> Array:
        return np.array([channel.si(columns.pop(channel.column)) for channel in wanted])

    time = channels.time.si(np.array(columns.pop(channels.time.column)))
    samples = Samples(
        source=str(path),
        robot=robot,
        time=time,
        position=rows(channels.position),
        effort=rows(channels.effort) if need_effort else None,
        row=np.arange(1, len(time) + 1),
    )
    samples, audited = audit(samples)
    findings += audited
    signals = {"effort": samples.effort}
    for signal, places in optional.items():
        values = rows(places)[:, samples.row - 1] if samples.count < len(time) else rows(places)
        if np.isfinite(values).all():
            signals[signal] = values
        else:
            findings.append(lacking_numbers(samples, signal, [channel.column for channel in places], values))
    if second:
        signals["link_position"] = link = np.full_like(samples.position, np.nan)
        link[list(second)] = rows(list(second.values()))[:, samples.row - 1]
    if signals["effort"] is not None:
        signals["effort"] = signals["effort"] * robot.effort_gain[:, None]

    name = recording_name(path)
    trajectory, repetition = split_name(name)
    return Recording(
        name=name,
        trajectory=trajectory,
        repetition=repetition,
        joints=robot.joints,
        time=samples.time,
        position=samples.position,
        findings=tuple(findings),
        path=None,
        **signals,
    )


def read_recordings(words: Sequence[Path | str], robot: Robot, *, need_effort: bool = True) -> tuple[Recording, ...]:
    """Read files, folders of recordings and globs.

    Parameters
    ----------
    words : sequence of path or str
        Each a file, a folder (its recordings in natural order, not those of its folders; the folder of a rosbag2
        recording is one recording) or a glob.
    robot : Robot
        See `read_recording`.
    need_effort : bool
        See `read_recording`.

    Returns
    -------
    tuple of Recording
        In order of appearance, each file once.

    Raises
    ------
    UsageError
        A word that is no file, folder or matching glob.
    RecordingError
        A folder or glob without recordings, two files of one stem, or a recording that cannot be used.

    Examples
    --------
    >>> from scara_ident import load_robot, named_motion, read_recordings, simulate, virtual_arm, write_recording
    >>> robot = load_robot()
    >>> run = simulate(virtual_arm(robot), named_motion("OJK", robot), rate=250.0)
    >>> write_recording(run.recording, "OJK_1.parquet")
    >>> read_recordings(["OJK_*.parquet"], robot)
    (Recording(OJK_1: 2 joints, 5001 samples at 250 Hz),)
    """
    return tuple(read_recording(path, robot, need_effort=need_effort) for path in recording_paths(words))


def read_usable(
    words: Sequence[Path | str], robot: Robot, *, needed: bool = True
) -> tuple[tuple[Recording, ...], list[str]]:
    """Read recordings with effort, without those that cannot be used, and say which; at least one if it is needed.

    Raises
    ------
    UsageError, RecordingError
        As `read_recordings`; that of the first recording if none can be used.
    """
    found, notes, errors = [], [], []
    for path in recording_paths(words):
        try:
            found.append(read_recording(path, robot))
        except RecordingError as error:
            errors.append(error)
            notes.append(f"{error}; left out")
    if needed and errors and not found:
        raise errors[0]
    return tuple(found), notes


def recording_paths(words: Sequence[Path | str]) -> tuple[Path, ...]:
    """List the files that words on a command line stand for; see `read_recordings`."""
    found: dict[Path, Path] = {}
    stems: dict[str, Path] = {}
    for word in words:
        for path in _paths(str(word)):
            real = real_path(path)
            if real in found:
                continue
            name = recording_name(path)
            if name in stems:
                raise RecordingError(
                    f"{stems[name]} and {path}: two recordings named {name!r}; rename one, results are listed by name"
                )
            found[real] = stems[name] = path
    return tuple(found.values())


def write_recording(recording: Recording, path: Path | str, *, effort_gain: Array | None = None) -> None:
    """Write a recording to a file, whole or not at all.

    Parameters
    ----------
    recording : Recording
    path : path
        Parquet or CSV, by its suffix. An existing file is replaced.
    effort_gain : ndarray, shape (n,), optional
        The robot's gains; efforts are divided by them, so that reading with that robot gives them back.

    Raises
    ------
    RecordingError
        Another suffix, or a place that cannot be written to.
    """
    write_columns(Path(path), recording_columns(recording, effort_gain))


def _paths(word: str) -> list[Path]:
    path = Path(word)
    if path.is_dir() and not is_bag_folder(path):
        found = _in_folder(path)
        if not found:
            raise RecordingError(
                f"{path}: no .parquet or .csv file in this folder, nor another recording ({_others()}); "
                "name one that holds recordings"
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


def _others() -> str:
    return ", ".join([*IMPORTERS.names()[2:], "rosbag2 folder"])


def _in_folder(folder: Path) -> list[Path]:
    files = [f for f in folder.iterdir() if is_recording(f) and f.name[0] != "."]
    return sorted(files, key=lambda file: _natural(file.name))


def _natural(text: str) -> list[tuple[int, str]]:
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"([0-9]+)", text)]
