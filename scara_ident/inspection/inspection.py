"""What is in a file of recordings, and a first robot description for it."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.calling import asked_for
from scara_ident.errors import MemoryLimit, RecordingError, UsageError
from scara_ident.files import path_fault
from scara_ident.inspection.chain import arm_of, longest_chain
from scara_ident.inspection.guess import Guess, guess
from scara_ident.inspection.names import Meaning, meaning, meanings_by_place, nameless
from scara_ident.inspection.text import description_text, mapping
from scara_ident.manners import listed
from scara_ident.motion.motion import stretches
from scara_ident.motion.velocity_audit import audit_velocity, velocity_remarks
from scara_ident.recording.files import column_names, is_bag_folder, read_columns
from scara_ident.recording.recording import Recording, read_recording
from scara_ident.robot.description import check_description
from scara_ident.robot.examples import is_name, urdf_of
from scara_ident.robot.robot import Robot, build_robot, load_robot
from scara_ident.robot.signal_map import SIGNALS, contract_channels

# Joints that a note names.
MAX_NAMED = 6


@dataclass(frozen=True)
class Column:
    """A column of a file.

    Attributes
    ----------
    name : str
    kind : {"numbers", "whole numbers", "constant", "empty", "text"}
    samples, missing : int
        Rows, and those without a number.
    low, high : float or None
        Range of its numbers.
    quantity, joint, unit : str or None
        What it is taken for; by its name alone where it is no channel of the mapping.
    channel : bool
        Whether the mapping reads it.
    """

    name: str
    kind: str
    samples: int
    missing: int
    low: float | None
    high: float | None
    quantity: str | None
    joint: str | None
    unit: str | None
    channel: bool


@dataclass(frozen=True, eq=False)
class Inspection:
    """What was found in a file.

    Attributes
    ----------
    path : Path
    topics : dict of str to int
        Topics of joint states in a bag and their messages; empty for other files.
    topic : str or None
        The topic that was looked at.
    columns : tuple of Column
    mapping : dict
        Key ``recording`` of the robot description; empty where the columns are the contract's.
    notes, problems : tuple of str
        What to check, and what keeps the file from being read.
    recording : Recording or None
        As the other commands read it, with the audit's findings.
    refusal : str or None
        Why it cannot be read.
    description : str or None
        A first ``robot.yaml``; None without a URDF.
    """

    path: Path
    topics: Mapping[str, int]
    topic: str | None
    columns: tuple[Column, ...]
    mapping: Mapping[str, Any]
    notes: tuple[str, ...] = ()
    problems: tuple[str, ...] = ()
    recording: Recording | None = None
    refusal: str | None = None
    description: str | None = None


def inspect_file(
    path: Path | str,
    *,
    urdf: Path | str | None = None,
    robot: Path | str | None = None,
    joints: str | None = None,
    folder: Path | str = ".",
) -> Inspection:
    """Look into a file, guess which columns are an arm's channels, and audit it.

    Parameters
    ----------
    path : path
        A recording of any kind that can be read, or the folder of a rosbag2 recording.
    urdf : path, optional
        The arm, or the name of a robot of example-robot-data; without it columns are recognised by their names alone.
    robot : path, optional
        A robot description, whose mapping is then used instead of a guess.
    joints : str, optional
        Regular expression of the URDF's joints to identify; by default all but coupled ends such as a gripper's fingers.
    folder : path
        Where the description will stand: its ``urdf`` is relative to it.

    Raises
    ------
    RecordingError, RobotError
        In one line: the file or URDF cannot be read at all.
    UsageError
        Both `urdf` and `robot`, `joints` without `urdf` or of no joint, or no such file.
    """
    path = Path(path)
    if urdf is not None and robot is not None:
        raise UsageError(
            f"{asked_for('--urdf and --robot', 'urdf and robot')}: give one; a robot description names its URDF"
        )
    if (fault := path_fault(path)) is not None:
        raise UsageError(fault)
    if joints is not None and urdf is None:
        raise UsageError(
            f"{asked_for('--joints')}: says which joints of a URDF to identify; give {asked_for('--urdf')}"
        )
    if not path.exists():
        raise UsageError(f"{path}: no such file or folder")
    if path.is_dir() and not is_bag_folder(path):
        raise UsageError(f"{path}: is a folder; give one recording of it")
    if robot is not None:
        return _by_description(path, load_robot(robot))
    source = None if urdf is None else Path(urdf)
    arm = None if source is None else arm_of(urdf_of(source), joints)
    topics = _topics(path)
    topic = _likely_topic(path, topics, arm)
    names = column_names(path, topic)
    numbers = _numbers(path, names, topic)
    every = () if arm is None else (*arm.joints, *(name for name, _ in arm.locked))
    meanings = {name: meaning(name, every) for name in names}
    if arm is None or source is None:
        columns = tuple(_column(name, numbers.get(name), *_by_name(name), False) for name in names)
        return Inspection(path, topics, topic, columns, {})
    by_place = {}
    if nameless(names):
        by_place = meanings_by_place(numbers, (arm.n, len(longest_chain(arm))))
    found = guess(meanings | by_place, numbers, arm, stated=bool(topics))
    found.notes[:0] = arm.notes
    if by_place:
        found.notes.append("no header: columns recognised by their places and slopes; check every one")
    described = mapping(found, arm)
    if len(topics) > 1 and topic is not None:
        described = {"topic": topic, **described}
        found.notes.append(f"topic: {topic} taken of {', '.join(topics)}")
    where = source if is_name(source) else _relative(arm.urdf, Path(folder))
    text = description_text(found, arm, described, where, path)
    recording, refusal = (None, None) if not found.complete else _audited(path, text, arm)
    scale = None if recording is None else _scale(recording, arm, text)
    if scale is not None:
        found.notes.append(scale)
        text = description_text(found, arm, described, where, path)
    return Inspection(
        path=path,
        topics=topics,
        topic=topic,
        columns=_guessed_columns(names, numbers, meanings, found, every),
        mapping=described,
        notes=(*found.notes, *_of_velocity(recording), *_moving_alone(recording)),
        problems=tuple(found.problems),
        recording=recording,
        refusal=refusal,
        description=text,
    )


def _moving_alone(recording: Recording | None) -> list[str]:
    """Say how joints that move while others stand are identified alone: of the model of all little would be learnt."""
    if recording is None:
        return []
    idle = {joint for finding in recording.findings for joint in finding.idle}
    moving = [re.escape(name) for joint, name in enumerate(recording.joints) if joint not in idle]
    if not idle or not moving:
        return []
    one = "|".join(moving)
    alone = asked_for(f"--joints '{one}'", f"joints={one!r}")
    return [
        f"if no recording moves more than {listed(moving, MAX_NAMED)}, {alone} identifies "
        f"{'it' if len(moving) == 1 else 'them'} alone, with the other joints locked at their positions here"
    ]


def _by_description(path: Path, robot: Robot) -> Inspection:
    channels = robot.channels or contract_channels(robot.joints)
    topics = _topics(path)
    names = column_names(path, channels.topic)
    numbers = _numbers(path, names, channels.topic)
    places: dict[str, tuple[str, str | None]] = {}
    if channels.rate is None:
        places[channels.time.column] = ("time", None)
    for signal in SIGNALS:
        places |= {c.column: (signal, joint) for c, joint in zip(channels.of(signal), robot.joints, strict=True)}
    columns = []
    for name in names:
        if name in places:
            columns.append(_column(name, numbers.get(name), *places[name], None, True))
        else:
            columns.append(_column(name, numbers.get(name), *_by_name(name), False))
    recording, refusal = _read(path, robot)
    notes = _of_velocity(recording)
    return Inspection(
        path, topics, channels.topic, tuple(columns), {}, notes=notes, recording=recording, refusal=refusal
    )


def _topics(path: Path) -> dict[str, int]:
    if not (is_bag_folder(path) or path.suffix.lower() in (".mcap", ".db3", ".bag")):
        return {}
    from scara_ident.recording.files.rosbag import topics

    return topics(path)


def _likely_topic(path: Path, topics: Mapping[str, int], arm: Robot | None) -> str | None:
    """Return the topic with most of the arm's joints, then messages; None where there is no choice."""
    if len(topics) < 2:
        return next(iter(topics), None)

    def worth(topic: str) -> tuple[int, int]:
        joints = () if arm is None else arm.joints
        names = column_names(path, topic)
        return sum(f"{joint}.position" in names for joint in joints), topics[topic]

    return max(topics, key=worth)


def _numbers(path: Path, names: tuple[str, ...], topic: str | None) -> dict[str, Array]:
    """Read the columns that hold numbers."""
    try:
        return read_columns(path, names, topic)
    except MemoryLimit:
        raise
    except RecordingError:
        # One of them is a text, or they differ in length: one by one.
        found: dict[str, Array] = {}
        for name in names:
            try:
                found |= read_columns(path, [name], topic)
            except RecordingError:
                continue
        return found


def _by_name(name: str) -> tuple[str | None, str | None, str | None]:
    """Return quantity, joint and unit of a column by its name alone."""
    said = meaning(name)
    *before, last = re.split("[./]", name.strip("/"))
    joint = None if said.number is None else str(said.number)
    if before and meaning(last).quantity not in (None, "time") and meaning(last).number is None:
        joint = before[-1]
    return said.quantity, joint, said.unit


def _guessed_columns(
    names: tuple[str, ...],
    numbers: Mapping[str, Array],
    meanings: Mapping[str, Meaning],
    found: Guess,
    joints: Sequence[str],
) -> tuple[Column, ...]:
    places: dict[str, tuple[str, str | None, str | None]] = {}
    if found.time is not None:
        places[found.time] = ("time", None, found.time_unit)
    for quantity, signal in found.signals.items():
        side = " (motor)" if signal.side == "motor" else ""
        for k in found.joints:
            if k in signal.columns:
                unit = signal.units.get(k)
                places[signal.columns[k]] = (quantity, joints[k], None if unit is None else unit + side)
    columns = []
    for name in names:
        if name in places:
            columns.append(_column(name, numbers.get(name), *places[name], True))
            continue
        said = meanings[name]
        joint = None if said.joint is None else joints[said.joint]
        columns.append(_column(name, numbers.get(name), said.quantity, joint, said.unit, False))
    return tuple(columns)


def _column(
    name: str, values: Array | None, quantity: str | None, joint: str | None, unit: str | None, channel: bool
) -> Column:
    if values is None:
        return Column(name, "text", 0, 0, None, None, quantity, joint, unit, channel)
    finite = values[np.isfinite(values)]
    missing = len(values) - len(finite)
    if not len(finite):
        return Column(name, "empty", len(values), missing, None, None, quantity, joint, unit, channel)
    low, high = float(finite.min()), float(finite.max())
    kind = "constant" if low == high else "whole numbers" if np.array_equal(finite, np.rint(finite)) else "numbers"
    return Column(name, kind, len(values), missing, low, high, quantity, joint, unit, channel)


def _relative(urdf: Path, folder: Path) -> Path:
    return Path(os.path.relpath(urdf, folder.resolve()))


def _audited(path: Path, text: str, arm: Robot) -> tuple[Recording | None, str | None]:
    """Read the file as the text describes it, so that what is written is what was tried."""
    return _read(path, _described(text, arm))


def _described(text: str, arm: Robot) -> Robot:
    import yaml

    described = check_description(yaml.safe_load(text), Path("robot.yaml"))
    # The audit does not depend on the side, which is the user's to state.
    described = described.model_copy(update={"urdf": arm.urdf, "effort_side": described.effort_side or "joint"})
    return build_robot(described, Path("robot.yaml"))


def _scale(recording: Recording, arm: Robot, text: str) -> str | None:
    """Return what the URDF says of the scale of effort; None where a gear leaves the side open."""
    if recording.effort is None or any(arm.reduction != 1.0):
        return None
    from scara_ident.inspection.scale import scale_note

    return scale_note(recording, _described(text, arm))


def _of_velocity(recording: Recording | None) -> tuple[str, ...]:
    """Say how a recorded velocity differs from the slope of the positions."""
    if recording is None or recording.velocity is None:
        return ()
    try:
        longest = max(stretches(recording), key=lambda part: len(part.time))
    except RecordingError:
        return ()
    remarks = velocity_remarks([(recording.name, longest.rate, audit_velocity(recording, longest))])
    return tuple(remark for _, remark in remarks)


def _read(path: Path, robot: Robot) -> tuple[Recording | None, str | None]:
    channels = robot.channels or contract_channels(robot.joints)
    names = column_names(path, channels.topic)
    has_effort = all(channel.column in names for channel in channels.effort)
    try:
        return read_recording(path, robot, need_effort=has_effort), None
    except RecordingError as error:
        return None, str(error)
