"""One run of one trajectory: reading, writing and gathering recordings."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError
from scara_ident.manners import Reported
from scara_ident.recording.audit import Finding, Samples, audit, once
from scara_ident.recording.columns import recording_columns
from scara_ident.recording.even_rows import with_even_clock
from scara_ident.recording.files import column_names, read_columns, shares_clock
from scara_ident.recording.files.parquet_csv import write_columns
from scara_ident.recording.files.parquet_rows import read_rows
from scara_ident.recording.locked import read_beside_locked
from scara_ident.recording.long_file import LongFile, long_file
from scara_ident.recording.one_clock import on_one_clock, sparse_channel
from scara_ident.recording.paths import distinct_names, recording_name, recording_paths
from scara_ident.recording.wanted import encoding_finding, lacking_numbers, optional_channels, refuse_missing
from scara_ident.robot.signal_map import SIGNALS, Channel, Channels, contract_channels

if TYPE_CHECKING:
    from scara_ident.robot.robot import Robot


@dataclass(frozen=True, eq=False, repr=False)
class Recording(Reported, reported_by="recording"):
    """One run of one trajectory.

    Attributes
    ----------
    name : str
        Stem of the file.
    trajectory : str
        The stem without a trailing ``_<number>``.
    repetition : int
        That number; 1 if the stem has none.
    joints : tuple of str
        The n joints, in the robot's order.
    time : ndarray, shape (N,)
        Time in s, strictly increasing.
    position : ndarray, shape (n, N)
        Joint positions in rad or m.
    effort : ndarray, shape (n, N), or None
        Torque in N m or force in N on the robot's effort side, after ``effort_gain``.
    velocity, acceleration : ndarray, shape (n, N), or None
        As recorded, in rad/s (m/s) and rad/s^2 (m/s^2); None if absent for any joint.
    temperature : ndarray, shape (n, N), or None
        In deg C.
    link_position : ndarray, shape (n, N), or None
        From a second encoder behind the gear, in rad or m; NaN for a joint without one, None if no joint has one.
    findings : tuple of Finding
        Findings of the audit, and how they were treated.
    path : Path or None
        The file that it was read from.
    long : LongFile or None
        The file, if it is too long for the memory and the recording is only the part kept of it; see `read_parts`.
    cuts : tuple of int
        Samples before which a part of a long file is cut, like the whole file.

    Raises
    ------
    RecordingError
        If shapes disagree or time does not increase.
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
    long: LongFile | None = None
    cuts: tuple[int, ...] = ()

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


def read_recording(path: Path | str, robot: Robot, *, need_effort: bool = True) -> Recording:
    """Read a recording and audit it.

    Parameters
    ----------
    path : path
        A file with a suffix known to `scara_ident.recording.files`, or the folder of a rosbag2 recording.
    robot : Robot
        It defines the joints, their order, their columns and units, and the gain of the recorded effort.
    need_effort : bool
        Whether a file without efforts is refused. If False, efforts are read if they are complete.

    Returns
    -------
    Recording
        For a Parquet file of more than `scara_ident.recording.long_file.LONGEST_WHOLE` samples: windows spread over it.

    Raises
    ------
    RecordingError
        In one line: the file, the column and row, and what to do.
    """
    path = Path(path)
    channels = robot.channels or contract_channels(robot.joints)
    shared = shares_clock(path, channels.time.column)
    names = column_names(path, channels.topic)
    placed = (channel.column for signal in SIGNALS for channel in channels.of(signal))
    used = [channels.time.column, *(column for column in placed if column in names)]
    # Without a clock it is not known where a long file has gaps.
    whole = shared or channels.rate is not None
    long = None if whole else long_file(path, channels.time.column, used)
    if long is not None:
        return _kept(long, robot, need_effort=need_effort)

    def read(wanted: Sequence[str]) -> dict[str, Array]:
        return read_columns(path, wanted, channels.topic)

    found = recording_of(path, names, read, robot, channels, need_effort=need_effort, shared_clock=shared)
    return replace(found, path=path, findings=(*encoding_finding(path), *found.findings))


def read_parts(long: LongFile, robot: Robot) -> Iterator[Recording | RecordingError]:
    """Read a long file part by part, all of it; a part that the audit refuses is given as what is wrong with it."""
    for bounds in long.parts:
        try:
            yield _rows_of(long, bounds, robot, need_effort=True)
        except RecordingError as error:
            yield error


def refuse_backwards(part: Recording, before: float) -> None:
    """Refuse a part of a long file whose time is not after that of the one before, s."""
    if part.time[0] <= before:
        raise RecordingError(f"{part.path}: time runs backwards at {part.time[0]:.6g} s; sort the rows by time")


def _rows_of(long: LongFile, bounds: Sequence[int], robot: Robot, *, need_effort: bool) -> Recording:
    channels = robot.channels or contract_channels(robot.joints)

    def read(wanted: Sequence[str]) -> dict[str, Array]:
        return read_rows(long.path, wanted, bounds[0], bounds[-1])

    names = column_names(long.path)
    found = recording_of(long.path, names, read, robot, channels, need_effort=need_effort, bounds=bounds)
    return replace(found, path=long.path, long=long)


def _kept(long: LongFile, robot: Robot, *, need_effort: bool) -> Recording:
    """Read what is kept of a long file; windows that the audit refuses are left out, unless all are."""
    parts: list[Recording] = []
    errors = []
    for bounds in long.windows:
        try:
            part = _rows_of(long, bounds, robot, need_effort=need_effort)
            refuse_backwards(part, parts[-1].time[-1] if parts else -np.inf)
            parts.append(part)
        except RecordingError as error:
            errors.append(error)
    if not parts:
        raise errors[0]
    starts = np.cumsum([0, *(len(part.time) for part in parts)])
    cuts = [[start, *(start + cut for cut in part.cuts)] for start, part in zip(starts, parts, strict=False)]

    def together(signal: str) -> Array | None:
        values = [getattr(part, signal) for part in parts]
        return None if any(value is None for value in values) else np.concatenate(values, axis=1)

    said = once(chain.from_iterable(part.findings for part in parts))
    kept = int(starts[-1])
    if long.windows != (long.bounds,):
        where = f"of its {long.samples} samples {kept} are used, in {len(parts)} windows spread over it"
        said.append(
            Finding("long", f"too long for the memory: {where}; identify uses all samples", long.samples - kept)
        )
    said += [Finding("refused", f"{error}; that window is left out") for error in errors[:1]]
    return replace(
        parts[0],
        time=np.concatenate([part.time for part in parts]),
        position=np.concatenate([part.position for part in parts], axis=1),
        effort=together("effort"),
        velocity=together("velocity"),
        acceleration=together("acceleration"),
        temperature=together("temperature"),
        link_position=together("link_position"),
        findings=tuple(said),
        cuts=tuple(int(cut) for cut in chain.from_iterable(cuts))[1:],
    )


def recording_of(
    path: Path,
    names: Sequence[str],
    read: Callable[[Sequence[str]], dict[str, Array]],
    robot: Robot,
    channels: Channels,
    *,
    need_effort: bool = True,
    shared_clock: bool = False,
    bounds: Sequence[int] = (0,),
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
    channels : Channels
        Where the robot's signals stand.
    need_effort : bool
        See `read_recording`.
    shared_clock : bool
        Whether rows may hold only some of the channels.
    bounds : sequence of int
        Of the rows of a long file the first that is given, and those at which its pieces begin and end.

    Raises
    ------
    RecordingError
        As `read_recording`.
    """
    names, read, stated = with_even_clock(path, names, read, channels, shared_clock=shared_clock)
    needed = [channels.time, *channels.position, *(channels.effort if need_effort else ())]
    refuse_missing(path, names, [channel.column for channel in needed], channels)
    optional, findings = optional_channels(path, channels, names, () if need_effort else ("effort",))
    findings += stated
    second = {k: place for k, place in enumerate(channels.link_position) if place.column in names}
    extra = (*chain.from_iterable(optional.values()), *second.values())
    wanted = [channel.column for channel in (*needed, *extra)]
    columns, moving = read_beside_locked(wanted, names, read, robot, channels)
    findings += moving
    if shared_clock:
        asked = [channel.column for channel in needed[1:]]
        if (sparse := sparse_channel(columns, asked)) is not None:
            raise RecordingError(f"{path}: {sparse}")
        lacking = [channel.column for channel in extra]
        columns, joined = on_one_clock(columns, channels.time.column, asked, lacking)
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
        row=np.arange(1, len(time) + 1) + bounds[0],
    )
    samples, audited = audit(samples)
    place = samples.row - 1 - bounds[0]
    findings += audited
    signals = {"effort": samples.effort}
    for signal, places in optional.items():
        values = rows(places)[:, place] if samples.count < len(time) else rows(places)
        if np.isfinite(values).all():
            signals[signal] = values
        else:
            findings.append(lacking_numbers(samples, signal, [channel.column for channel in places], values))
    if second:
        signals["link_position"] = link = np.full_like(samples.position, np.nan)
        link[list(second)] = rows(list(second.values()))[:, place]
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
        long=None,
        cuts=tuple(np.searchsorted(samples.row, np.asarray(bounds[1:-1]) + 1).tolist()),
        **signals,
    )


def read_recordings(
    words: Path | str | Sequence[Path | str], robot: Robot, *, need_effort: bool = True
) -> tuple[Recording, ...]:
    """Read files, folders of recordings and globs.

    Parameters
    ----------
    words : path or str, or a sequence of these
        Each is a file, a folder (its recordings in natural order, without sub-folders; the folder of a rosbag2
        recording is one recording) or a glob.
    robot : Robot
        See `read_recording`.
    need_effort : bool
        See `read_recording`.

    Returns
    -------
    tuple of Recording
        In order of appearance, each file once; see `distinctly_named`.

    Raises
    ------
    UsageError
        If a word is no file, folder or matching glob.
    RecordingError
        If a folder or glob has no recordings, two files in one folder have the same stem, or a recording cannot be
        used.

    Examples
    --------
    >>> from scara_ident import load_robot, named_motion, read_recordings, simulate, virtual_arm, write_recording
    >>> robot = load_robot()
    >>> run = simulate(virtual_arm(robot), named_motion("OJK", robot), rate=250.0)
    >>> write_recording(run.recording, "OJK_1.parquet")
    >>> read_recordings(["OJK_*.parquet"], robot)
    (Recording(OJK_1: 2 joints, 5001 samples at 250 Hz),)
    """
    return distinctly_named([read_recording(path, robot, need_effort=need_effort) for path in recording_paths(words)])


def distinctly_named(recordings: Sequence[Recording]) -> tuple[Recording, ...]:
    """Return recordings of which those of one name, out of several folders, are named with their folder: results are by name."""
    called = Counter(recording.name for recording in recordings)
    of_files = {recording.path for recording in recordings if recording.path is not None and called[recording.name] > 1}
    names = dict(zip(of_files, distinct_names(list(of_files)), strict=True))
    return tuple(
        replace(recording, name=names[recording.path]) if recording.path in names else recording
        for recording in recordings
    )


def write_recording(recording: Recording, path: Path | str, *, effort_gain: Array | None = None) -> None:
    """Write a recording to a file, completely or not at all.

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
        If the suffix is another one, or the file cannot be written.
    """
    write_columns(Path(path), recording_columns(recording, effort_gain))
