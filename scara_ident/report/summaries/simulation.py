"""Summary, columns and figure of a simulation: its recording, and the truth behind it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from scara_ident.report.summaries import recording
from scara_ident.report.summaries.words import text_of
from scara_ident.simulation.simulate import SimulationResult

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def summary(result: SimulationResult) -> str:
    """Return the recording, the effects that were switched on, and the seed."""
    effects = ", ".join(str(effect) for effect in result.effects) or "none"
    behind = f"effects: {effects}; seed {result.seed}, repetition {result.repetition}; {result.stops} stops"
    return text_of(recording.recordings_table([result.recording]), behind)


def columns(result: SimulationResult) -> dict[str, Any]:
    """Return the recorded signals."""
    return recording.columns(result.recording)


def figure(result: SimulationResult) -> Figure:
    """Draw the recorded signals."""
    return recording.figure(result.recording)
