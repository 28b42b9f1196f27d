"""Measured against predicted torque over time, and where the error is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from scara_ident.estimators import JointError
from scara_ident.report.html.page import Cell, Group, Selector, Text, escape, table
from scara_ident.report.html.plot import Figure, Grid, Layer, Line, Panel, Plot
from scara_ident.report.html.traces import Trace
from scara_ident.robot import Robot

Array = NDArray[np.float64]

# Samples per period of the band that are drawn of signals within it: straight lines between them then show its shape.
DRAWN_PER_PERIOD = 16.0
# Samples of recorded torque on the whole page; longer recordings are drawn as envelopes of as many samples as needed.
MOST_SAMPLES = 1_500_000


def torque_group(
    robot: Robot, parts: Mapping[str, Sequence[Trace]], bands: Sequence[float | None], held_out: set[str]
) -> Group:
    """Return measured, predicted and residual torque over time, selectable by recording and joint.

    Parameters
    ----------
    robot : Robot
    parts : mapping of str to sequence of Trace
        By recording.
    bands : sequence of float or None, one per joint
        Hz.
    held_out : set of str
        Recordings that were not fitted.
    """
    total = robot.n * sum(part.motion.samples for traces in parts.values() for part in traces)
    bucket = max(1, int(np.ceil(2.0 * total / MOST_SAMPLES))) if total > MOST_SAMPLES else 1
    variants = {
        (r, j): _plot(robot, traces, j, bands[j], bucket)
        for r, traces in enumerate(parts.values())
        for j in range(robot.n)
    }
    names = tuple(f"{name} ({'held out' if name in held_out else 'fitted'})" for name in parts)
    figure = Figure(
        "torque",
        "Measured and predicted torque",
        "Recorded torque as it is; measured and predicted torque within the band that the estimate used; below, their difference.",
        variants,
        (0, 1),
    )
    return Group("torque-group", (figure,), (Selector("recording", names), Selector("joint", robot.joints)))


def _plot(robot: Robot, traces: Sequence[Trace], j: int, band: float | None, bucket: int) -> Plot:
    above: list[Layer] = []
    below: list[Layer] = []
    for trace in traces:
        above.append(_line(trace, trace.recorded[j], bucket, "grey", "recorded", 0.8))
    for trace in traces:
        grid, measured = banded(trace, trace.measured[j], band)
        _, predicted = banded(trace, trace.predicted[j], band)
        above.append(Line(grid, measured, "blue", "measured", 1.6))
        above.append(Line(grid, predicted, "vermillion", "predicted", 1.4, "5 3"))
        below.append(Line(grid, measured - predicted, "green", "residual", 1.2))
    unit = robot.torque_unit(j)
    return Plot("time [s]", (Panel(f"torque [{unit}]", above, 260), Panel(f"residual [{unit}]", below, 130)))


def banded(trace: Trace, signal: Array, band: float | None) -> tuple[Grid, Array]:
    """Return a signal within a band without its ends, at as many samples as straight lines between them need."""
    every = 1 if band is None else max(1, int(trace.motion.rate / (DRAWN_PER_PERIOD * band)))
    inner = np.full(len(signal), np.nan)
    inner[trace.core] = signal[trace.core]
    return _grid(trace, every), inner[::every]


def _grid(trace: Trace, every: int) -> Grid:
    step = every / trace.motion.rate
    return Grid(float(trace.time[0]), step, -(-trace.motion.samples // every))


def _line(trace: Trace, signal: Array, bucket: int, color: str, name: str, width: float) -> Line:
    if bucket == 1:
        return Line(_grid(trace, 1), signal, color, name, width)
    values = envelope(signal, bucket)
    step = 0.5 * bucket / trace.motion.rate
    return Line(Grid(float(trace.time[0]) + 0.5 * step, step, len(values)), values, color, name, width)


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


def error_table(
    robot: Robot,
    fitted: Mapping[str, Sequence[JointError | None]],
    held_out: Mapping[str, Sequence[JointError | None]],
    shown: Sequence[str],
) -> Text:
    """Return the error of every recording and joint; a click shows it in the torque figure."""
    found = [error for errors in (*fitted.values(), *held_out.values()) for error in errors if error and error.relative]
    most = max((error.relative or 0.0 for error in found), default=1.0)
    rows = []
    for kind, recordings in (("held out", held_out), ("fitted", fitted)):
        for name, errors in recordings.items():
            cells: list[Cell | str] = [Cell(escape(name), "name"), kind]
            for j, error in enumerate(errors):
                cells += _error_cells(error, shown.index(name), j, most)
            rows.append(cells)
    head = ["recording", ""]
    for j, joint in enumerate(robot.joints):
        head += [f"{joint} [{robot.torque_unit(j)}]", "of torque"]
    return table(head, rows, numeric=range(2, len(head)))


def _error_cells(error: JointError | None, recording: int, j: int, most: float) -> list[Cell | str]:
    if error is None:
        return ["–", "–"]
    button = f'<button type="button" data-choose="torque-group" data-values="[{recording},{j}]">{error.rms:.3g}</button>'
    if error.relative is None:
        return [Cell(button, "num"), "–"]
    return [Cell(button, "num"), Cell(f"{error.relative:.1%}", "num", error.relative / most)]
