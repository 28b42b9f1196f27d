"""The clock of a file that has none, whose rows are even: the rate is stated in the robot description."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError
from scara_ident.recording.audit import Finding
from scara_ident.robot.signal_map import Channels

Read = Callable[[Sequence[str]], dict[str, Array]]


def with_even_clock(
    path: Path, names: Sequence[str], read: Read, channels: Channels, *, shared_clock: bool = False
) -> tuple[Sequence[str], Read, list[Finding]]:
    """Put the time of even rows beside the columns of a file, where a rate is stated.

    Parameters
    ----------
    path : Path
        Named in errors.
    names : sequence of str
        Columns that there are.
    read : callable
        Returns some of them, each of shape (N,).
    shared_clock : bool
        Whether rows may hold only some of the channels, so that they are not even.

    Raises
    ------
    RecordingError
        If the rows have stamps of their own by their format.
    """
    rate, clock = channels.rate, channels.time.column
    if rate is None:
        return names, read, []
    if shared_clock:
        raise RecordingError(f"{path}: its rows have stamps and need not be even; take recording: time: rate out")

    def read_with(wanted: Sequence[str]) -> dict[str, Array]:
        found = read([name for name in wanted if name != clock])
        rows = len(next(iter(found.values())))
        return {clock: np.arange(rows) / rate, **found}

    ignored = f"; its column {clock!r} is not used" if clock in names else ""
    said = f"the rows are taken as even, {rate:g} in a second, as the robot description states{ignored}"
    return (*names, clock), read_with, [Finding("stated_rate", said)]
