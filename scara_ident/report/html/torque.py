"""Measured against predicted torque over time, and where the error is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from scara_ident.arrays import Array, runs_of
from scara_ident.estimation import JointError
from scara_ident.report.html.blocks import Cell, Group, Selector, Table, name, number
from scara_ident.report.plot import Drawing, Figure, Grid, Layer, Line, Panel, Plot, Region
from scara_ident.report.traces import Trace
from scara_ident.robot.robot import Robot

# Samples per period of the band that are drawn of signals within it: straight lines between them then show its shape.
DRAWN_PER_PERIOD = 16.0
# Samples of recorded torque on the whole page; longer recordings are drawn as envelopes of as many samples as needed.
MAX_SAMPLES = 1_500_000
# Times left out that are shorter than this share of a recording are not marked.
MIN_MARKED = 400
WORDS = (
    "Recorded: the effort in the file times its gain, unfiltered. Measured: the same within the band that the estimate "
    "used; predicted torque is in this band too. Below: measured minus predicted, faded out towards rest as in the "
    "estimate."
)


def torque_group(robot: Robot, parts: Sequence[tuple[str, Sequence[Trace]]], bands: Sequence[float | None]) -> Group:
    """Return measured, predicted and residual torque over time, selectable by recording and joint.

    Parameters
    ----------
    parts : sequence of (str, sequence of Trace)
        Recordings, by the words of the selector.
    bands : sequence of float or None, one per joint
        Hz.
    """
    total = sum(
        trace.motion.samples * (1.0 + 3.0 / _every(trace, band))
        for _, found in parts
        for trace in found
        for band in bands
    )
    bucket = int(np.ceil(2.0 * total / MAX_SAMPLES)) if total > MAX_SAMPLES else 1
    variants: dict[tuple[int, ...], Drawing] = {
        (r, j): torque_plot(robot, found, j, bands[j], bucket)
        for r, (_, found) in enumerate(parts)
        for j in range(robot.n)
    }
    figure = Figure("torque", "Measured and predicted torque", WORDS, variants, (0, 1))
    names = tuple(name for name, _ in parts)
    return Group("torque-group", (figure,), (Selector("recording", names), Selector("joint", robot.joints)))


def torque_plot(robot: Robot, traces: Sequence[Trace], j: int, band: float | None, bucket: int = 1) -> Plot:
    """Return recorded, measured, predicted and residual torque of a joint over time.

    Parameters
    ----------
    traces : sequence of Trace
        Of one recording.
    j : int
        Joint.
    band : float or None
        Hz.
    bucket : int, optional
        Samples of which only the extremes are drawn.
    """
    above: list[Layer] = []
    below: list[Layer] = []
    for trace in traces:
        above.append(Line(_grid(trace, 1), trace.recorded[j], "grey", "recorded", 0.8).thinned(bucket))
    for trace in traces:
        grid, measured = banded(trace, trace.measured[j], band)
        _, predicted = banded(trace, trace.predicted[j], band)
        above.append(Line(grid, measured, "blue", "measured", 1.6).thinned(bucket))
        above.append(Line(grid, predicted, "vermillion", "predicted", 1.4, "5 3").thinned(bucket))
        _, residual = banded(trace, trace.residual[j], band)
        used = trace.used[j, :: _every(trace, band)]
        above += unused_regions(trace, j)
        below += unused_regions(trace, j)
        # What the estimate does not use may be far larger, and must not set the scale.
        idle = Line(grid, np.where(used, np.nan, residual), "grey", "residual, not used", 1.0).thinned(bucket)
        below.append(replace(idle, fit=not np.any(used)))
        below.append(Line(grid, np.where(used, residual, np.nan), "green", "residual", 1.2).thinned(bucket))
    unit = robot.torque_unit(j)
    return Plot("time [s]", (Panel(f"torque [{unit}]", above, 260), Panel(f"residual [{unit}]", below, 130)))


def unused_regions(trace: Trace, j: int) -> list[Layer]:
    """Return strips over the times that the estimate of a joint leaves out, but for moments that could not be seen."""
    seen = max(1, trace.motion.samples // MIN_MARKED)
    return [
        Region((float(trace.time[start]), float(trace.time[stop - 1])), "grey", "not used: ends, standstill", 0.25)
        for start, stop in runs_of(~trace.used[j])
        if stop - start > seen
    ]


def banded(trace: Trace, signal: Array, band: float | None) -> tuple[Grid, Array]:
    """Return a signal within a band without its ends, at as many samples as straight lines between them need."""
    every = _every(trace, band)
    inner = np.full(len(signal), np.nan)
    inner[trace.core] = signal[trace.core]
    return _grid(trace, every), inner[::every]


def _every(trace: Trace, band: float | None) -> int:
    return 1 if band is None else max(1, int(trace.motion.rate / (DRAWN_PER_PERIOD * band)))


def _grid(trace: Trace, every: int) -> Grid:
    return Grid(float(trace.time[0]), every / trace.motion.rate, -(-trace.motion.samples // every))


def error_table(robot: Robot, names: Sequence[str], errors: Sequence[Sequence[JointError | None]]) -> Table:
    """Return the error of every recording and joint; a click shows it in the torque figure.

    Parameters
    ----------
    names : sequence of str
        In the order of the torque figure's selector.
    errors : sequence of sequence of JointError or None
        By recording and joint.
    """
    most = max((error.relative for found in errors for error in found if error and error.relative), default=1.0)
    rows = [
        [name(recording), *(_error_cell(error, place, j, most) for j, error in enumerate(found))]
        for place, (recording, found) in enumerate(zip(names, errors, strict=True))
    ]
    head = ["recording", *(f"{joint} [{robot.torque_unit(j)}]" for j, joint in enumerate(robot.joints))]
    return Table(head, rows, range(1, len(head)))


def _error_cell(error: JointError | None, recording: int, j: int, most: float) -> Cell:
    if error is None:
        return Cell("at rest", "num")
    choose = ("torque-group", (recording, j))
    if error.relative is None:
        return Cell(number(error.rms), "num", choose=choose)
    beside = "" if error.rms_own_offset is None else f", {number(error.rms_own_offset)} with its own offset"
    return Cell(number(error.rms), strength=error.relative / most, note=f"{error.relative:.1%}{beside}", choose=choose)
