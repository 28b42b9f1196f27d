"""Friction over velocity with its band, and the velocities that the data cover (Fig. 4 of Indri et al. 2002)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation import Estimate
from scara_ident.model.terms import Friction
from scara_ident.report.bins import binned_means, middle_range
from scara_ident.report.html.blocks import Group
from scara_ident.report.plot import Band, Dots, Figure, Layer, Line, Panel, Plot, Region, single
from scara_ident.report.traces import Trace, kept

# How far beyond the data the curve is drawn, and points on each side of standstill.
BEYOND = 1.3
POINTS = 160
COVERAGE_BINS = 48
# Means per direction of motion.
MEAN_BINS = 20


def friction_group(estimate: Estimate, traces: Sequence[Trace]) -> Group | None:
    """Return the friction of every joint; None where the model has no friction.

    Parameters
    ----------
    traces : sequence of Trace
        Of the recordings that were fitted.
    """
    term = next((term for term in estimate.model.terms if isinstance(term, Friction)), None)
    if term is None:
        return None
    figures = [figure for j in range(estimate.model.robot.n) for figure in _figures(estimate, term, traces, j)]
    return Group("friction-group", figures, (), "two" if len(figures) < 3 else "three") if figures else None


def friction_curve(term: Friction, estimate: Estimate, j: int, v: Array) -> tuple[Array, Array]:
    """Return the friction of a joint at velocities and its standard deviation, each (N,)."""
    robot, k = estimate.model.robot, len(term.powers)
    start = estimate.model.place(term).start + j * k
    place = slice(start, start + k)
    speed = robot.drive_sign[j] * v
    columns = np.array(
        [speed**power if power % 2 else np.sign(speed) * np.abs(speed) ** power for power in term.powers]
    )
    variance = np.einsum("kn,kl,ln->n", columns, estimate.covariance[place, place], columns)
    return estimate.value[place] @ columns, np.sqrt(np.clip(variance, 0.0, None))


def _figures(estimate: Estimate, term: Friction, traces: Sequence[Trace], j: int) -> list[Figure]:
    robot = estimate.model.robot
    v = kept(traces, [trace.motion.v[j] for trace in traces], j)
    if len(v) < COVERAGE_BINS:
        return []
    partial = kept(traces, [trace.residual[j] + trace.friction[j] for trace in traces], j)
    low, high = middle_range(v, 0.999)
    most = BEYOND * max(abs(low), abs(high))
    side = np.linspace(0.0, most, POINTS)
    # Zero lies in a gap: Coulomb friction jumps there.
    grid = np.concatenate([-side[:0:-1], [-1e-9 * most, 0.0, 1e-9 * most], side[1:]])
    value, std = friction_curve(term, estimate, j, grid)
    value[grid == 0.0] = np.nan
    std[~np.isfinite(std)] = np.nan
    inside = (grid >= low) & (grid <= high)
    layers: list[Layer] = [*_coverage(v, most)]
    layers.append(Band(grid, value - 2.0 * std, value + 2.0 * std, "blue", "± 2 std", fit=False))
    layers += _means(v, partial, low, high)
    layers.append(Line(grid, np.where(inside, value, np.nan), "blue", "friction", 2.0))
    layers.append(Line(grid, np.where(inside, np.nan, value), "blue", "beyond the data", 1.6, "3 4"))
    unit = robot.torque_unit(j)
    return [
        single(
            f"friction-{j}",
            f"Friction of {robot.joints[j]}",
            "",
            Plot(f"velocity [{robot.position_unit(j)}/s]", (Panel(f"friction [{unit}]", layers, 230),), (-most, most)),
        )
    ]


def _means(v: Array, partial: Array, low: float, high: float) -> list[Layer]:
    """Means over velocity, each direction for itself: a bin over standstill would mix the two."""
    found: list[Layer] = []
    for side, limits in ((v < 0.0, (low, min(high, 0.0))), (v > 0.0, (max(low, 0.0), high))):
        if limits[1] <= limits[0] or np.count_nonzero(side) < MEAN_BINS:
            continue
        means = binned_means(v[side], partial[side], limits, MEAN_BINS)
        filled = np.isfinite(means.y)
        bars = 2.0 * means.error[filled]
        found.append(
            Dots(means.x[filled], means.y[filled], "vermillion", "measured minus the rest of the model", bars, 2.0)
        )
    return found


def _coverage(v: Array, most: float) -> list[Layer]:
    """Strips that are darker where there are more samples."""
    counts, edges = np.histogram(v, COVERAGE_BINS, (-most, most))
    max_counted = int(counts.max())
    return [
        Region(
            (float(a), float(b)),
            "orange",
            "velocities in the data",
            round(0.08 + 0.85 * float(count / max_counted) ** 0.5, 3),
            0.06,
        )
        for count, a, b in zip(counts, edges[:-1], edges[1:], strict=True)
        if count
    ]
