"""Joints that the model locks and a recording moves: what they do acts on the others as torque that the model lacks."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError
from scara_ident.recording.audit import Finding
from scara_ident.robot.signal_map import SIGNALS, Channel, Channels

if TYPE_CHECKING:
    from scara_ident.robot.robot import Robot

# rad or m by which a locked joint may move before it is said.
MAX_TRAVEL = 0.01


def read_beside_locked(
    wanted: Sequence[str],
    names: Sequence[str],
    read: Callable[[Sequence[str]], dict[str, Array]],
    robot: Robot,
    channels: Channels,
) -> tuple[dict[str, Array], list[Finding]]:
    """Read columns of a recording, and say which joints move in it though the model locks them.

    Parameters
    ----------
    wanted, names : sequence of str
        Columns to read, and those that there are.
    read : callable
        Returns some of them, each of shape (N,).
    """
    places = locked_channels(robot, channels, names)
    more = [channel.column for channel in places.values()]
    try:
        columns = read([*wanted, *more])
    except RecordingError:
        # What is wrong with a column that nothing needs is no matter.
        return read(wanted), []
    found = moving_though_locked(robot, places, columns)
    return {name: columns[name] for name in wanted}, found


def locked_channels(robot: Robot, channels: Channels, names: Collection[str]) -> dict[str, Channel]:
    """Return where the positions of locked joints stand, by joint: columns named as those of the identified ones are.

    Parameters
    ----------
    names : collection of str
        Columns that there are.
    """
    found: dict[str, Channel] = {}
    taken = {channel.column for signal in SIGNALS for channel in channels.of(signal)}
    for name, _ in robot.locked:
        for joint, own in zip(robot.joints, channels.position, strict=True):
            column = own.column.replace(joint, name)
            if joint in own.column and column in names and column not in taken:
                found[name] = Channel(column, own.factor, own.offset)
                break
    return found


def moving_though_locked(robot: Robot, places: Mapping[str, Channel], columns: Mapping[str, Array]) -> list[Finding]:
    """Say which locked joints move.

    Parameters
    ----------
    places : mapping of str to Channel
        See `locked_channels`.
    columns : mapping of str to ndarray, shape (N,)
        Numbers of the file, by column.
    """
    found = []
    for name, place in robot.locked:
        if name not in places:
            continue
        channel = places[name]
        values = columns[channel.column][np.isfinite(columns[channel.column])]
        if not len(values) or abs(channel.factor) * float(np.ptp(values)) <= MAX_TRAVEL:
            continue
        said = (
            f"{name} is locked at {place:.3g} in the model, and its column {channel.column!r} goes from {values.min():.3g} to "
            f"{values.max():.3g}: its motion causes torques on the other joints that the model does not have; name it "
            f"under joints: in robot.yaml, or use recordings in which it does not move"
        )
        found.append(Finding("moving_lock", said, len(values)))
    return found
