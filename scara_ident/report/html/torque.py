"""Measured against predicted torque over time, and where the error is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scara_ident.estimation import JointError
from scara_ident.report.html.page import Cell, Group, Selector, Text, escape, number, table
from scara_ident.report.html.plot import Drawing, Figure, Grid, Layer, Line, Panel, Plot, Region
from scara_ident.report.html.traces import Trace
from scara_ident.robot.robot import Robot

Array = NDArray[np.float64]

# Samples per period of the band that are drawn of signals within it: straight lines between them then show its shape.
DRAWN_PER_PERIOD = 16.0
# Samples of recorded torque on the whole page; longer recordings are drawn as envelopes of as many samples as needed.
MOST_SAMPLES = 1_500_000
# Times left out that are shorter than this share of a recording are not marked.
LEAST_SEEN = 400


def torque_group(robot: Robot, parts: Sequence[tuple[str, Sequence[Trace]]], bands: Sequence[float | None]) -> Group:
    """Return measured, predicted and residual torque over time, selectable by recording and joint.

    Parameters
    ----------
    robot : Robot
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
    bucket = int(np.ceil(2.0 * total / MOST_SAMPLES)) if total > MOST_SAMPLES else 1
    variants: dict[tuple[int, ...], Drawing] = {
        (r, j): _plot(robot, found, j, bands[j], bucket) for r, (_, found) in enumerate(parts) for j in range(robot.n)
    }
    figure = Figure(
        "torque",
        "Measured and predicted torque",
        "Recorded torque as it is; measured and predicted torque within the band that the estimate used; below, their difference.",
        variants,
        (0, 1),
    )
    names = tuple(name for name, _ in parts)
    return Group("torque-group", (figure,), (Selector("recording", names), Selector("joint", robot.joints)))


def _plot(robot: Robot, traces: Sequence[Trace], j: int, band: float | None, bucket: int) -> Plot:
    above: list[Layer] = []
    below: list[Layer] = []
    for trace in traces:
        above.append(_line(_grid(trace, 1), trace.recorded[j], bucket, "grey", "recorded", 0.8))
    for trace in traces:
        grid, measured = banded(trace, trace.measured[j], band)
        _, predicted = banded(trace, trace.predicted[j], band)
        above.append(_line(grid, measured, bucket, "blue", "measured", 1.6))
        above.append(_line(grid, predicted, bucket, "vermillion", "predicted", 1.4, "5 3"))
        residual, used = measured - predicted, trace.used[j, :: _every(trace, band)]
        below += unused_regions(trace, j)
        # What the estimate does not use may be far larger, and must not set the scale.
        idle = _line(grid, np.where(used, np.nan, residual), bucket, "grey", "residual, not used", 1.0)
        below.append(replace(idle, fit=not np.any(used)))
        below.append(_line(grid, np.where(used, residual, np.nan), bucket, "green", "residual", 1.2))
    unit = robot.torque_unit(j)
    return Plot("time [s]", (Panel(f"torque [{unit}]", above, 260), Panel(f"residual [{unit}]", below, 130)))


def unused_regions(trace: Trace, j: int) -> list[Layer]:
    """Return strips over the times that the estimate of a joint leaves out."""
    return [Region(limits, "grey", "not used: ends, standstill", 0.25) for limits in _unused(trace, j)]


def _unused(trace: Trace, j: int) -> list[tuple[float, float]]:
    """Return the times that the estimate leaves out, but for moments that could not be seen."""
    left_out = np.concatenate([[False], ~trace.used[j], [False]])
    edges = np.flatnonzero(np.diff(left_out.astype(np.int8))).reshape(-1, 2)
    seen = max(1, trace.motion.samples // LEAST_SEEN)
    return [
        (float(trace.time[start]), float(trace.time[stop - 1]))
        for start, stop in edges[edges[:, 1] - edges[:, 0] > seen].tolist()
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
    step = every / trace.motion.rate
    return Grid(float(trace.time[0]), step, -(-trace.motion.samples // every))


def _line(grid: Grid, signal: Array, bucket: int, color: str, name: str, width: float, dash: str = "") -> Line:
    if bucket == 1:
        return Line(grid, signal, color, name, width, dash)
    values, step = envelope(signal, bucket), 0.5 * bucket * grid.step
    # Two values stand for a bucket, at its quarter and at its three quarters.
    return Line(Grid(grid.start + 0.5 * (step - grid.step), step, len(values)), values, color, name, width, dash)


def envelope(signal: Array, bucket: int) -> Array:
    """Return the lowest and highest of every ``bucket`` samples, in the order in which they came.

    Parameters
    ----------
    signal : ndarray, shape (N,)
    bucket : int

    Returns
    -------
    ndarray, shape (2 ceil(N / bucket),)
    """
    missing = (-len(signal)) % bucket
    rows = np.pad(signal, (0, missing), mode="edge").reshape(-1, bucket)
    low, high = rows.min(axis=1), rows.max(axis=1)
    rises = rows.argmin(axis=1) <= rows.argmax(axis=1)
    return np.column_stack([np.where(rises, low, high), np.where(rises, high, low)]).ravel()


def error_table(robot: Robot, names: Sequence[str], errors: Sequence[Sequence[JointError | None]]) -> Text:
    """Return the error of every recording and joint; a click shows it in the torque figure.

    Parameters
    ----------
    robot : Robot
    names : sequence of str
        In the order of the torque figure's selector.
    errors : sequence of sequence of JointError or None
        By recording and joint.
    """
    shares = [error.relative for found in errors for error in found if error and error.relative]
    most = max(shares, default=1.0)
    rows: list[list[Cell | str]] = []
    for place, (name, found) in enumerate(zip(names, errors, strict=True)):
        cells: list[Cell | str] = [Cell(escape(name), "name")]
        for j, error in enumerate(found):
            cells.append(_error_cell(error, place, j, most))
        rows.append(cells)
    head = ["recording", *(f"{joint} [{robot.torque_unit(j)}]" for j, joint in enumerate(robot.joints))]
    return table(head, rows, numeric=range(1, len(head)))


def _error_cell(error: JointError | None, recording: int, j: int, most: float) -> Cell | str:
    if error is None:
        return "at rest"
    button = (
        f'<button type="button" data-choose="torque-group" data-values="[{recording},{j}]">{number(error.rms)}</button>'
    )
    if error.relative is None:
        return Cell(button, "num")
    return Cell(f"{button} <small>{error.relative:.1%}</small>", "num", error.relative / most)
