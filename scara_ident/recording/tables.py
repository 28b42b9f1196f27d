"""Recordings out of arrays and data frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from scara_ident.arrays import Array
from scara_ident.errors import ArgumentError, RecordingError
from scara_ident.recording.audit.samples import Finding
from scara_ident.recording.recording import Recording, recording_of
from scara_ident.robot.signal_map import contract_channels

if TYPE_CHECKING:
    from scara_ident.robot.robot import Robot

# What is said of arrays beside a description that maps columns: advice on that mapping would change nothing.
AS_THEY_ARE = (
    "arrays are taken in rad or m as they are: what the robot's description says under recording (scale, offset, columns) is for "
    "files and data frames; change the arrays instead"
)


def read_arrays(
    time: ArrayLike,
    position: ArrayLike,
    effort: ArrayLike | None,
    robot: Robot,
    *,
    velocity: ArrayLike | None = None,
    name: str = "arrays",
) -> Recording:
    """Make a recording from arrays and audit it, as `read_recording` does with a file.

    The mapping under ``recording`` of the robot description (columns, units, scales, offsets) is for files and data
    frames. Arrays are used as they are; if there is such a mapping, a finding says so.

    Parameters
    ----------
    time : array_like, shape (N,)
        In s; points in time (``datetime64``) are counted from the first.
    position : array_like, shape (N, n)
        In rad or m, one column for each of ``robot.joints``; shape (N,) is allowed for one joint.
    effort : array_like, shape (N, n), or None
        As recorded; ``effort_gain`` converts it to N m (N).
    robot : Robot
    velocity : array_like, shape (N, n), optional
        In rad/s or m/s.
    name : str, optional
        Name of the recording: ``<trajectory>_<repetition>``, like a file's stem.

    Returns
    -------
    Recording

    Raises
    ------
    ArgumentError
        If `robot` is no robot, or an array contains no real numbers.
    RecordingError
        If shapes disagree, or the audit refuses the samples.

    Examples
    --------
    >>> import numpy as np
    >>> from scara_ident import load_robot, read_arrays
    >>> time = np.arange(500) / 250
    >>> position = np.stack([np.sin(time), np.cos(3 * time)], axis=1)
    >>> read_arrays(time, position, None, load_robot()).position.shape
    (2, 500)
    """
    check_robot(robot)
    clock = np.asarray(time)
    clock = _column(name, "time", clock) if clock.ndim == 1 and clock.dtype.kind in "mM" else _real(name, "time", time)
    if clock.ndim != 1:
        raise RecordingError(f"{name}: time has shape {clock.shape}; expected one number for each sample")
    columns = {"time": clock}
    for signal, values in (("position", position), ("effort", effort), ("velocity", velocity)):
        if values is None:
            continue
        array = _real(name, signal, values)
        if robot.n == 1 and array.ndim == 1:
            array = array[:, None]
        if array.shape != (len(clock), robot.n):
            turned = "; transpose it" if array.shape == (robot.n, len(clock)) else ""
            raise RecordingError(
                f"{name}: {signal} has shape {array.shape}; expected {(len(clock), robot.n)}, a row for each time and a "
                f"column for each of {', '.join(robot.joints)}{turned}"
            )
        columns |= {f"{joint}.{signal}": array[:, k] for k, joint in enumerate(robot.joints)}

    def read(wanted: Sequence[str]) -> dict[str, Array]:
        return {column: columns[column].copy() for column in wanted}

    channels = contract_channels(robot.joints)
    found = recording_of(Path(name), tuple(columns), read, robot, channels, need_effort=effort is not None)
    if robot.channels in (None, channels):
        return found
    return replace(found, findings=(*found.findings, Finding("mapping", AS_THEY_ARE)))


def read_frame(frame: Any, robot: Robot, *, name: str = "frame", need_effort: bool = True) -> Recording:
    """Make a recording from a data frame and audit it, as `read_recording` does with a file.

    Parameters
    ----------
    frame : polars.DataFrame or pandas.DataFrame
        With the columns that the robot description names, otherwise ``time``, ``<joint>.position``, ``<joint>.effort``.
        The index of a pandas frame may be the time.
    robot : Robot
    name : str, optional
        See `read_arrays`.
    need_effort : bool, optional
        See `read_recording`.

    Returns
    -------
    Recording

    Raises
    ------
    ArgumentError
        If the frame is no data frame, or the robot no robot.
    RecordingError
        If a column is missing or contains no numbers, or the audit refuses the samples.
    """
    check_robot(robot)
    if hasattr(frame, "collect"):
        raise ArgumentError(f"frame: a {type(frame).__name__}, whose rows are not computed yet; give its collect()")
    if not (hasattr(frame, "columns") and hasattr(frame, "__getitem__")):
        raise ArgumentError(f"frame: expected a data frame of polars or pandas; found {type(frame).__name__}")
    channels = robot.channels or contract_channels(robot.joints)
    clock = channels.time.column
    names = [str(column) for column in frame.columns]
    index = getattr(frame, "index", None)
    indexed = clock not in names and index is not None and (index.name == clock or index.dtype.kind == "M")

    def read(wanted: Sequence[str]) -> dict[str, Array]:
        return {
            column: _column(name, column, index if indexed and column == clock else frame[column]) for column in wanted
        }

    return recording_of(
        Path(name), (*names, clock) if indexed else names, read, robot, channels, need_effort=need_effort
    )


def check_robot(robot: object) -> None:
    """Refuse what is no `Robot`.

    Raises
    ------
    ArgumentError
    """
    from scara_ident.robot.robot import Robot

    if not isinstance(robot, Robot):
        raise ArgumentError(f"robot: expected a Robot, as load_robot gives; found {type(robot).__name__}")


def _real(source: str, name: str, values: ArrayLike) -> Array:
    try:
        array = np.asarray(values)
    except ValueError:
        raise ArgumentError(f"{source}: {name} has rows of different lengths; expected an array") from None
    if array.dtype.kind not in "fiu":
        raise ArgumentError(f"{source}: {name} holds {array.dtype}; expected real numbers")
    return array.astype(np.float64)


def _column(source: str, name: str, values: Any) -> Array:
    """Return a column in float64; points in time in s since the first."""
    array = np.asarray(values)
    if array.ndim != 1:
        raise RecordingError(f"{source}: column {name!r} is in it twice; rename one of them")
    if array.dtype.kind == "M":
        array = array - array[~np.isnat(array)][:1]
    if array.dtype.kind == "m":
        seconds: Array = np.where(np.isnat(array), np.nan, array / np.timedelta64(1, "ns") / 1e9)
        return seconds
    try:
        return np.asarray(array, dtype=np.float64).copy()
    except (TypeError, ValueError):
        raise RecordingError(f"{source}: column {name!r} holds {array.dtype}; it must hold numbers") from None
