"""Which columns of a file are wanted, and what is said where they are not there."""

from __future__ import annotations

import re
from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from shlex import quote

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import RecordingError
from scara_ident.recording.audit import Finding, Samples
from scara_ident.recording.files.csv_layout import ENCODINGS, csv_layout
from scara_ident.robot.signal_map import SIGNALS, Channel, Channels

OPTIONAL = ("velocity", "acceleration", "temperature")


def refuse_missing(path: Path, names: Sequence[str], wanted: Sequence[str], channels: Channels) -> None:
    """Refuse a file without columns that are wanted, and say which it has.

    Raises
    ------
    RecordingError
    """
    missing = [name for name in wanted if name not in names]
    if not missing:
        return
    if names and all(re.fullmatch("column_[0-9]+", name) for name in names):
        raise RecordingError(
            f"{path}: the first line holds numbers; put the column names there (time, {wanted[1]}, ...), or map "
            f"column_1 to column_{len(names)} under recording: in the robot description"
        )
    name = missing[0]
    more = f" (and {len(missing) - 1} more)" if len(missing) > 1 else ""
    ending = name.rpartition(".")[2]
    mapped = _declaring(channels, name)
    have = [other for other in names if other.endswith(f".{ending}")] if "." in name and not mapped else list(names)
    # A column that holds another signal is not the one looked for.
    used = {channels.time.column, *(channel.column for signal in SIGNALS for channel in channels.of(signal))}
    lower = {other.lower(): other for other in names if other not in used}
    near = get_close_matches(name.lower(), lower, n=1, cutoff=0.75)
    guess = f"is it {lower[near[0]]!r}? " if near else ""
    kind = f"{ending} columns" if "." in name and not mapped else "columns"
    shown = ", ".join(have[:8]) + (", ..." if len(have) > 8 else "") if have else "none"
    remedy = "rename the column, or correct the joints in the robot description; one for these columns "
    remedy += f"writes: scara-ident inspect {quote(str(path))} --urdf URDF"
    if mapped:
        remedy = f"correct recording: {mapped} in the robot description"
    elif len(missing) == len(wanted) and path.exists():
        remedy = f"map its columns in the robot description; a first one writes: scara-ident inspect {quote(str(path))}"
    elif missing == [channels.time.column]:
        remedy = (
            "name the column of time in the robot description, or state the rate of even rows, samples per second: "
        )
        remedy += "recording: {time: {rate: 100}}"
    raise RecordingError(f"{path}: no column {name!r}{more}; {guess}its {kind}: {shown}; {remedy}")


def encoding_finding(path: Path) -> list[Finding]:
    """Say that a CSV file, whose columns could be listed, is read as what it does not say that it is."""
    if path.suffix.lower() != ".csv" or csv_layout(path).encoding != ENCODINGS[-1]:
        return []
    return [Finding("encoding", "the file is not in UTF-8: read as Windows-1252")]


def _declaring(channels: Channels, column: str) -> str:
    """Return the signal for which the robot description names a column, or nothing."""
    for signal in channels.declared:
        places = (channels.time,) if signal == "time" else channels.of(signal)
        if any(channel.column == column for channel in places):
            return signal
    return ""


def optional_channels(
    path: Path, channels: Channels, names: Sequence[str], more: Sequence[str]
) -> tuple[dict[str, tuple[Channel, ...]], list[Finding]]:
    """Return the channels of optional signals that are there for every joint, and what is said of the others."""
    found: dict[str, tuple[Channel, ...]] = {}
    findings = []
    for signal in (*more, *OPTIONAL):
        wanted = channels.of(signal)
        absent = [channel.column for channel in wanted if channel.column not in names]
        if not absent:
            found[signal] = wanted
        elif signal in channels.declared:
            refuse_missing(path, names, absent, channels)
        elif len(absent) < len(wanted):
            said = f"no {', '.join(absent)}, but other joints have {signal}: the {signal} columns are not used"
            findings.append(Finding("missing_column", said, len(absent)))
    return found, findings


def lacking_numbers(samples: Samples, signal: str, names: Sequence[str], values: Array) -> Finding:
    """Say that a signal is left out because numbers of it lack."""
    joint = int(np.argmax((lacking := ~np.isfinite(values)).any(axis=1)))
    said = (
        f"{names[joint]} is empty, NaN or infinite in {int(lacking[joint].sum())} of {samples.count} rows, "
        f"first in {samples.where(int(np.argmax(lacking[joint])))}: the {signal} columns are not used"
    )
    return Finding("nan", said, int(lacking.sum()))
