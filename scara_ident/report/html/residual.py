"""The residual against each signal, its spectra and its autocorrelation."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from itertools import product

import numpy as np

from scara_ident.arrays import Array
from scara_ident.report.bins import MEAN_BINS, binned_means, density, middle_range
from scara_ident.report.html.blocks import Block, Group, Heading, Paragraph, Selector
from scara_ident.report.plot import (
    Band,
    Density,
    Drawing,
    Figure,
    Layer,
    Level,
    Line,
    Mark,
    Panel,
    Plot,
    Region,
    mean_layers,
)
from scara_ident.report.spectra import ORDER_WORDS, autocorrelation, orders, spectrum
from scara_ident.report.traces import Trace, kept
from scara_ident.robot.robot import Robot

Sets = Mapping[str, Sequence[Trace]]
Variants = dict[tuple[int, ...], Drawing]


def residual_blocks(robot: Robot, sets: Sets, bands: Sequence[float | None]) -> list[Block]:
    """Return the figures of the residual.

    Parameters
    ----------
    sets : mapping of str to sequence of Trace
        Such as the fitted and the held-out recordings; empty ones are left out.
    bands : sequence of float or None, one per joint
        Hz.
    """
    sets = {name: traces for name, traces in sets.items() if traces}
    still = [joint for j, joint in enumerate(robot.joints) if not any(_turns(robot, s, j) for s in sets.values())]
    which = "any joint" if len(still) == robot.n else ", ".join(still)
    motor = (
        f" No figure over the motor angle of {which}: with the given reductions the motor turns less than once."
        if still
        else ""
    )
    return [
        Heading("Against signals"),
        Paragraph(
            "Blue: density of the samples. Vermillion: their mean over the signal, ± two standard errors; where the "
            f"mean is not zero, the model lacks something that depends on the signal.{motor}"
        ),
        _signals_group(robot, sets),
        Heading("By frequency, motor angle and lag"),
        _spectra_group(robot, sets, bands),
    ]


def _turns(robot: Robot, traces: Sequence[Trace], j: int) -> bool:
    """Whether a joint's motor makes a full turn, so that its angle is another signal than the joint's position."""
    span = 2.0 * np.pi / abs(robot.reduction[j])
    return any(float(np.ptp(trace.motion.q[j])) >= span for trace in traces)


def _spectra_group(robot: Robot, sets: Sets, bands: Sequence[float | None]) -> Group:
    by_time: Variants = {}
    by_order: Variants = {}
    by_lag: Variants = {}
    for s, traces in enumerate(sets.values()):
        for j in range(robot.n):
            unit = robot.torque_unit(j)
            for found, plot in (
                (by_time, _frequency_plot(traces, j, bands[j], unit)),
                (by_order, _order_plot(robot, traces, j, unit)),
                (by_lag, _lag_plot(traces, j)),
            ):
                if plot is not None:
                    found[j, s] = plot
    figures = [
        Figure(
            "frequency",
            "Spectrum over frequency",
            "Amplitude density of the recorded torque (the effort in the file times its gain) and of the residual, both unfiltered; the area reaches up to the highest line of each bin. In the grey range, above the band, the prediction contains the noise of the position.",
            by_time,
            (0, 1),
        ),
        Figure(
            "order",
            "Spectrum over the motor's angle",
            f"The part that repeats with the motor's angle. Noise alone crosses the dashed bound somewhere in 1 of 100 cases. {ORDER_WORDS}",
            by_order,
            (0, 1),
        ),
        Figure(
            "lag",
            "Autocorrelation",
            "Within the band, from the first lag on (it is 1 at lag 0). White residuals are between the dashed bounds at 95 % of the lags.",
            by_lag,
            (0, 1),
        ),
    ]
    kept = [figure for figure in figures if figure.variants]
    return Group("spectra-group", kept, _selectors(robot, sets), "two")


def _selectors(robot: Robot, sets: Sets) -> tuple[Selector, Selector]:
    return Selector("residual of", robot.joints), Selector("recordings", tuple(sets))


def _frequency_plot(traces: Sequence[Trace], j: int, band: float | None, unit: str) -> Plot | None:
    recorded = spectrum([(trace.recorded[j, trace.core], trace.motion.rate) for trace in traces])
    left = spectrum([(trace.raw_residual[j, trace.core], trace.motion.rate) for trace in traces])
    if recorded is None or left is None:
        return None
    layers: list[Layer] = [
        Line(recorded.frequency, recorded.mean, "grey", "recorded torque"),
        Band(left.frequency, left.mean, left.highest, "green"),
        Line(left.frequency, left.mean, "green", "residual"),
    ]
    if band is not None:
        layers.insert(0, Region((band, float(recorded.frequency[-1])), "grey", "", 0.15))
        layers.append(Mark(band, "black", f"band {band:.3g} Hz"))
    return Plot("frequency [Hz]", (Panel(f"density [{unit}/√Hz]", layers, 220, log=True),), log=True)


def _order_plot(robot: Robot, traces: Sequence[Trace], j: int, unit: str) -> Plot | None:
    found = orders(robot, traces, j, [trace.residual[j] for trace in traces])
    if found is None:
        return None
    layers = (
        Line(found.order, found.bound, "black", "bound of noise", 1.0, "4 3"),
        Line(found.order, found.amplitude, "green", "residual"),
    )
    return Plot("order [1 / motor turn]", (Panel(f"amplitude [{unit}]", layers, 220),))


def _lag_plot(traces: Sequence[Trace], j: int) -> Plot | None:
    found = autocorrelation(traces, j)
    if found is None:
        return None
    layers: list[Layer] = [
        Line(found.lag[1:], found.value[1:], "green", "autocorrelation", 1.6),
        Level(found.bound, "black", "bounds of white noise"),
        Level(-found.bound, "black", "bounds of white noise"),
    ]
    return Plot("lag [s]", (Panel("correlation", layers, 220),))


def _signals_group(robot: Robot, sets: Sets) -> Group:
    signals: tuple[tuple[str, str, Callable[[Trace, int], Array], Callable[[int], str]], ...] = (
        ("position", "Position", lambda trace, i: trace.motion.q[i], lambda i: f"position [{robot.position_unit(i)}]"),
        ("velocity", "Velocity", lambda trace, i: trace.motion.v[i], lambda i: f"velocity [{robot.position_unit(i)}/s]"),
        ("acceleration", "Acceleration", lambda trace, i: trace.motion.a[i], lambda i: f"acceleration [{robot.position_unit(i)}/s²]"),
        ("load", "Load", lambda trace, i: trace.load[i], lambda i: f"links and rotors [{robot.torque_unit(i)}]"),
        ("time", "Time", lambda trace, i: trace.time, lambda i: "time since the start [s]"),
        ("motor", "Motor angle", lambda trace, i: np.mod(robot.reduction[i] * trace.motion.q[i], 2.0 * np.pi), lambda i: "within a motor turn [rad]"),
    )  # fmt: skip
    figures = []
    for name, title, signal, label in signals:
        variants: Variants = {}
        for (s, traces), j in product(enumerate(sets.values()), range(robot.n)):
            y = kept(traces, [trace.residual[j] for trace in traces], j)
            # Time is the same for all joints.
            for i in range(1 if name == "time" else robot.n) if len(y) else ():
                if name == "motor" and not _turns(robot, traces, i):
                    continue
                x = kept(traces, [signal(trace, i) for trace in traces], j)
                variants[(j, s) if name == "time" else (j, s, i)] = scatter(x, y, label(i), robot.torque_unit(j))
        by = (0, 1) if name == "time" else (0, 1, 2)
        figures.append(Figure(f"against-{name}", title, "", variants, by, quiet=True))
    selectors = (*_selectors(robot, sets), Selector("signals of", robot.joints))
    return Group("signals-group", figures, selectors, "three")


def scatter(x: Array, y: Array, label: str, unit: str, height: int = 170, bins: int = MEAN_BINS) -> Plot:
    """Return how samples of a residual lie over a signal, and their means.

    Parameters
    ----------
    x, y : ndarray, shape (N,)
        Signal and residual, in the order of time.
    label : str
        Of the signal, with its unit.
    unit : str
        Of the residual.
    height : int, optional
        Pixels.
    bins : int, optional
        Of the means.
    """
    limits = middle_range(x)
    reach = 1.25 * float(np.quantile(np.abs(y), 0.995)) or 1.0
    means = binned_means(x, y, limits, bins)
    layers = (
        Density(density(x, y, limits, (-reach, reach)), limits, (-reach, reach), "blue", "samples"),
        *mean_layers(means, "vermillion", "mean ± 2 s.e."),
    )
    return Plot(label, (Panel(f"residual [{unit}]", layers, height, (-reach, reach)),), limits, small=True)
