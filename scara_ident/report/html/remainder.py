"""The unexplained residual over the signals that it depends on."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from scara_ident.arrays import Array
from scara_ident.diagnosis.evidence.outcome import Unexplained
from scara_ident.report.bins import binned_means, middle_range
from scara_ident.report.html.blocks import Group
from scara_ident.report.html.residual import scatter
from scara_ident.report.plot import Figure, Matrix, rounded, single
from scara_ident.report.traces import Trace, kept
from scara_ident.robot.robot import Robot

# Bins of each signal of a pair.
PAIR_BINS = 12
# Bins of the means over one signal.
MEANS = 48


def remainder_group(robot: Robot, remainder: Unexplained, traces: Sequence[Trace]) -> Group | None:
    """Return what is left of a joint over each signal that it depends on, and over two of them together.

    Parameters
    ----------
    traces : sequence of Trace
        Of the training recordings, with the effects found.

    Returns
    -------
    Group or None
        None where no signal is known.
    """
    j = robot.joints.index(remainder.joint)
    y = kept(traces, [trace.residual[j] for trace in traces], j)
    known = [(name, signal_of(robot, name, j)) for name in remainder.signals]
    found = [(name, *how) for name, how in known if how is not None]
    if not found or not len(y):
        return None
    unit = robot.torque_unit(j)
    signals = [kept(traces, [signal(trace) for trace in traces], j) for _, signal, _ in found]
    figures: list[Figure] = []
    for k, ((name, _, length), x) in enumerate(zip(found, signals, strict=True)):
        plot = scatter(x, y, f"{name} [{length}]", unit, height=220, bins=MEANS)
        figures.append(single(f"remainder-{k}", f"{remainder.joint}: what is left over {name}", "", plot))
    if len(signals) == 2:
        words = (
            f"Mean of the residual [{unit}]. Blue: the measured torque (recorded torque within the band) is above the "
            f"prediction; vermillion: below; grey: too few samples."
        )
        names = [f"{name} [{length}]" for name, _, length in found]
        matrix = replace(_pair(signals[0], signals[1], y), column_label=names[0], row_label=names[1])
        figures.append(single("remainder-pair", f"{remainder.joint}: what is left over both", words, matrix))
    return Group("remainder-group", figures, (), "two")


def signal_of(robot: Robot, name: str, j: int) -> tuple[Callable[[Trace], Array], str] | None:
    """Return how a signal that the screening names is taken from a trace, and its unit; None where it is not known."""
    kind, _, joint = name.partition(" of ")
    if joint in robot.joints:
        i = robot.joints.index(joint)
        length = robot.position_unit(i)
        if kind == "position":
            return (lambda trace: trace.motion.q[i]), length
        if kind == "velocity":
            return (lambda trace: trace.motion.v[i]), f"{length}/s"
        if kind == "acceleration":
            return (lambda trace: trace.motion.a[i]), f"{length}/s²"
    if name == "predicted torque":
        return (lambda trace: trace.predicted[j]), robot.torque_unit(j)
    if name == "time":
        return (lambda trace: trace.time), "s"
    if name == "motor angle":
        return (lambda trace: np.mod(robot.reduction[j] * trace.motion.q[j], 2.0 * np.pi)), "rad"
    return None


def _pair(x: Array, z: Array, y: Array) -> Matrix:
    (low, high), (bottom, top) = middle_range(x), middle_range(z)
    centres = bottom + (np.arange(PAIR_BINS) + 0.5) * (top - bottom) / PAIR_BINS
    rows = []
    for k in range(PAIR_BINS):
        inside = np.floor((z - bottom) / (top - bottom) * PAIR_BINS) == k
        if np.any(inside):
            rows.append(binned_means(x[inside], y[inside], (low, high), PAIR_BINS).y)
        else:
            rows.append(np.full(PAIR_BINS, np.nan))
    # The first row of a matrix stands at the top.
    values = np.array(rows[::-1])
    most = float(np.nanmax(np.abs(values))) if np.isfinite(values).any() else 1.0
    across = low + (np.arange(PAIR_BINS) + 0.5) * (high - low) / PAIR_BINS
    return Matrix([_tick(v) for v in centres[::-1]], [_tick(v) for v in across], values, most or 1.0)


def _tick(value: float) -> str:
    return f"{rounded(value) or 0.0:.3g}"
