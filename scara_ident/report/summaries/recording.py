"""Summary, columns and figure of a recording: how long and how fast it is, its audit, and its signals."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from scara_ident.recording.columns import recording_columns
from scara_ident.recording.recording import Recording
from scara_ident.report.plot import Line, Panel, Plot, single, style
from scara_ident.report.summaries.words import table, text_of

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from rich.table import Table


def summary(recording: Recording) -> str:
    """Return its size, and what the audit found."""
    return text_of(recordings_table([recording]), *(finding.message for finding in recording.findings))


def columns(recording: Recording) -> dict[str, Any]:
    """Return the signals, named as in a file of the format of this package."""
    return recording_columns(recording)


def figure(recording: Recording) -> Figure:
    """Draw position and, if recorded, effort of every joint over time."""
    from scara_ident.report.drawing import canvas

    signals = [("position [rad or m]", recording.position), ("effort [N m or N]", recording.effort)]
    panels = tuple(
        Panel(
            label,
            [
                Line(recording.time, row, style(j)[0], joint if k == 0 else "")
                for j, (joint, row) in enumerate(zip(recording.joints, signal, strict=True))
            ],
            220,
        )
        for k, (label, signal) in enumerate(signals)
        if signal is not None
    )
    return canvas(recording.name, [[single("signals", recording.name, "", Plot("time [s]", panels))]])


def recordings_table(recordings: Sequence[Recording]) -> Table:
    """Return samples, length, rate and number of findings of recordings."""
    numbers = ("samples", "s", "Hz", "findings")
    rows = table("recordings", "recording", *numbers, right=numbers)
    for item in recordings:
        seconds = item.time[-1] - item.time[0]
        rows.add_row(item.name, str(len(item.time)), f"{seconds:.4g}", f"{item.rate:.4g}", str(len(item.findings)))
    return rows
