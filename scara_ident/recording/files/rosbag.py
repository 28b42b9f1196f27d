"""Bags of ROS: joint states out of rosbag2 folders, MCAP and SQLite files, and of ROS 1."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError
from scara_ident.memory import within_limit
from scara_ident.recording.files.files import absent, check_file, damaged, optional_module

JOINT_STATE = "sensor_msgs/msg/JointState"
SIGNALS = ("position", "velocity", "effort")
# When the state was measured (the header's stamp), and when the recorder received it.
TIME, RECEIVED = "time", "receive_time"


def topics(path: Path) -> dict[str, int]:
    """List the topics of joint states and how many messages each has."""
    with _opened(path) as bag:
        found: dict[str, int] = {}
        for connection in bag.connections:
            if connection.msgtype == JOINT_STATE:
                found[connection.topic] = found.get(connection.topic, 0) + connection.msgcount
        if not found:
            others = sorted({connection.msgtype for connection in bag.connections})
            raise RecordingError(
                f"{path}: no {JOINT_STATE} in it (it has {', '.join(others[:6]) or 'nothing'}); "
                "record the topic of the joint states"
            )
    return found


def column_names(path: Path, topic: str | None = None) -> tuple[str, ...]:
    """List the columns: ``time``, ``receive_time`` and ``<joint>.position``, ``.velocity``, ``.effort``.

    Both times are in s since the first message. Joints are those that any message of the topic names.

    Parameters
    ----------
    path : Path
        The folder of a rosbag2 recording, or one of its files.
    topic : str, optional
        Needed where the bag has several topics of joint states.

    Raises
    ------
    RecordingError
        rosbags is not installed, the bag is damaged, or the topic is missing or must be chosen.
    """
    return tuple(_columns(path, topic))


def read_columns(path: Path, names: Sequence[str], topic: str | None = None) -> dict[str, Array]:
    """Read some columns as float64; NaN where a message does not name that joint.

    Raises
    ------
    RecordingError
        As `column_names`; also where the header's stamps are wanted and all are 0.
    """
    columns = _columns(path, topic)
    for name in names:
        if name not in columns:
            raise absent(path, name)
    if TIME in names and not columns[TIME].any() and len(columns[TIME]) > 1:
        raise RecordingError(
            f"{path}: the stamps in the headers are all the same; use the recorder's clock: "
            f"recording: {{time: {{column: {RECEIVED}}}}} in the robot description"
        )
    return {name: columns[name].copy() for name in names}


def _columns(path: Path, topic: str | None) -> dict[str, Array]:
    _check(path)
    found = topics(path)
    if topic is None:
        if len(found) > 1:
            raise RecordingError(
                f"{path}: joint states on {len(found)} topics, {', '.join(found)}; choose one: "
                "recording: {topic: ...} in the robot description"
            )
        topic = next(iter(found))
    elif topic not in found:
        raise RecordingError(f"{path}: no joint states on the topic {topic!r}; it has {', '.join(found)}")
    stamps = tuple(sorted((file.name, file.stat().st_mtime_ns, file.stat().st_size) for file in _files(path)))
    return _decoded(path.resolve(), topic, stamps)


# Names and numbers come out of one pass over the messages, and are asked for one after the other.
@lru_cache(maxsize=1)
def _decoded(path: Path, topic: str, _stamps: tuple[object, ...]) -> dict[str, Array]:
    stamps: list[int] = []
    received: list[int] = []
    rows: list[dict[str, float]] = []
    with _opened(path) as bag:
        chosen = [c for c in bag.connections if c.topic == topic and c.msgtype == JOINT_STATE]
        for connection, instant, raw in bag.messages(connections=chosen):
            message = bag.deserialize(raw, connection.msgtype)
            stamps.append(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)
            received.append(instant)
            row: dict[str, float] = {}
            for signal in SIGNALS:
                # A publisher leaves out a signal by an empty array.
                row |= {f"{n}.{signal}": v for n, v in zip(message.name, getattr(message, signal), strict=False)}
            rows.append(row)
    if not rows:
        raise RecordingError(f"{path}: no message on the topic {topic}; record it again")
    names = list(dict.fromkeys(name for row in rows for name in row))
    # Differences of whole nanoseconds, since a double of 1.7e18 ns has steps of 256.
    columns = {TIME: _seconds(stamps), RECEIVED: _seconds(received)}
    for joint in dict.fromkeys(name.rpartition(".")[0] for name in names):
        for signal in SIGNALS:
            if f"{joint}.{signal}" in names:
                name = f"{joint}.{signal}"
                columns[name] = np.array([row.get(name, np.nan) for row in rows])
    return columns


def _seconds(nanoseconds: list[int]) -> Array:
    return np.array([instant - nanoseconds[0] for instant in nanoseconds], dtype=float) / 1e9


def _files(path: Path) -> list[Path]:
    return [file for file in path.iterdir() if file.is_file()] if path.is_dir() else [path]


def _check(path: Path) -> None:
    for file in path.iterdir() if path.is_dir() else (path,):
        if not file.is_dir():
            check_file(file)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    _check(path)
    highlevel = optional_module("rosbags.highlevel", "ros", path)
    typesys = optional_module("rosbags.typesys", "ros", path)
    # Files of older recorders do not say what their messages are made of.
    store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
    try:
        with within_limit(path), highlevel.AnyReader([path], default_typestore=store) as bag:
            yield bag
    except RecordingError:
        raise
    except Exception as error:
        # The parsers of the storage formats fail in whatever way the damage makes them fail.
        raise damaged(path, path.suffix.lower().lstrip(".") or "rosbag2", error) from error
