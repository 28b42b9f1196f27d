"""The figures that show one effect: the residual before and after it entered."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from scara_ident.arrays import Array
from scara_ident.report.bins import Means, binned_means, middle_range, tail_means
from scara_ident.report.html.blocks import Group
from scara_ident.report.html.chapters import Chapter
from scara_ident.report.html.torque import banded, unused_regions
from scara_ident.report.plot import Figure, Layer, Line, Panel, Plot, mean_layers, single
from scara_ident.report.spectra import ORDER_WORDS, orders, spectrum
from scara_ident.report.traces import Trace, kept
from scara_ident.robot.robot import Robot


def _since_reversal(trace: Trace, j: int) -> Array:
    turns = np.flatnonzero(np.diff(np.sign(trace.motion.v[j]))) + 1
    last = np.zeros(trace.motion.samples, dtype=int)
    last[turns] = turns
    q = trace.motion.q[j]
    return np.asarray(np.abs(q - q[np.maximum.accumulate(last)]))


# Per signal of a view: its words, its unit, and what it is of a trace and a joint.
SIGNALS: dict[str, tuple[str, str, Callable[[Trace, int], Array]]] = {
    "position": ("position", "{position}", lambda trace, j: trace.motion.q[j]),
    "velocity": ("velocity", "{position}/s", lambda trace, j: trace.motion.v[j]),
    "acceleration": ("acceleration", "{position}/s²", lambda trace, j: trace.motion.a[j]),
    "time": ("time since the start", "s", lambda trace, j: trace.time),
    "torque": ("predicted torque", "{torque}", lambda trace, j: trace.predicted[j]),
    "torque rate": (
        "rate of the predicted torque",
        "{torque}/s",
        lambda trace, j: np.gradient(trace.predicted[j]) * trace.motion.rate,
    ),
    "load": ("size of the load", "{torque}", lambda trace, j: np.abs(trace.load[j])),
    "reversal": ("travel since the last reversal", "{position}", _since_reversal),
}
ADDED = "what it adds to the prediction"
LEFT = "measured minus the rest of the model"
LAW = "the effect as found"
# How far after a reversal an effect is shown, in the distances over which it acts.
SHOWN_DISTANCES = 8.0
# Samples after reversals that the figure holds at least, where the distance is short.
MIN_SAMPLES = 1000


def chapter_group(robot: Robot, chapter: Chapter) -> Group:
    """Return the figures that show an effect before and after."""
    if not any(np.any(trace.used[chapter.joint]) for trace in (*chapter.before, *chapter.after)):
        return Group(f"effect-{chapter.number}", (), (), "two")
    figures = [figure for figure in (_telling(robot, chapter), _own(robot, chapter)) if figure]
    return Group(f"effect-{chapter.number}", figures, (), "two")


def moment_group(robot: Robot, chapter: Chapter) -> Group:
    """Return the residual over time before and after on the recording where the effect is strongest."""
    j, added = chapter.joint, chapter.added
    gains = [_squares(a, j) - _squares(b, j) for a, b in zip(chapter.before, chapter.after, strict=True)]
    k = int(np.argmax(gains))
    before, after = chapter.before[k], chapter.after[k]
    layers: list[Layer] = [*unused_regions(after, j)]
    for trace, signal, color, name, dash in (
        (before, before.residual[j], "vermillion", "residual before", ""),
        (after, after.residual[j], "blue", "residual after", ""),
        (after, None if added is None else added[k], "black", ADDED, "4 3"),
    ):
        if signal is not None:
            grid, values = banded(trace, signal, chapter.bands[j])
            layers.append(Line(grid, values, color, name, 1.3, dash))
    panel = Panel(f"torque [{robot.torque_unit(j)}]", layers, 190)
    title = f"{robot.joints[j]} on {after.recording}, where it removes most"
    figure = single(f"effect-{chapter.number}-time", title, "", Plot("time [s]", (panel,)))
    return Group(f"effect-{chapter.number}-time-group", (figure,))


def _squares(trace: Trace, j: int) -> float:
    return float(np.sum(trace.residual[j][trace.used[j]] ** 2)) / max(1, int(np.count_nonzero(trace.used[j])))


def _telling(robot: Robot, chapter: Chapter) -> Figure | None:
    name, unit = f"effect-{chapter.number}-view", robot.torque_unit(chapter.joint)
    view, j = chapter.view, chapter.joint
    if view.signal == "order":
        return _by_order(robot, chapter, name, unit)
    if view.signal == "frequency":
        return _by_frequency(chapter, name, unit)
    if view.signal not in SIGNALS:
        # Over its own torque every effect is shown.
        return None
    label, signal_unit, signal = SIGNALS[view.signal]
    before, after = ([signal(trace, j) for trace in traces] for traces in (chapter.before, chapter.after))
    axis = f"{label} [{signal_unit.format(position=robot.position_unit(j), torque=unit)}]"
    plot = _means_plot(robot, chapter, before, after, axis)
    words = "Means with two standard errors"
    if view.along:
        words += ", in the direction of motion"
    words += "."
    if chapter.own is not None:
        words += " Above: measured torque (recorded torque within the band) minus what the rest of the model predicts. Below: the residual; without the effect, other parameters were biased by it."
    return single(name, f"{robot.joints[j]} over {label}", words, plot)


def _own(robot: Robot, chapter: Chapter) -> Figure | None:
    added = chapter.added
    if added is None:
        return None
    j, unit = chapter.joint, robot.torque_unit(chapter.joint)
    layers: list[Layer] = []
    for traces, color, name in (
        (chapter.before, "vermillion", "residual before"),
        (chapter.after, "blue", "residual after"),
    ):
        y = kept(traces, [trace.residual[j] for trace in traces], j)
        layers += mean_layers(tail_means(kept(traces, added, j), y), color, name)
    x = kept(chapter.after, added, j)
    ends = [float(np.min(x)), float(np.max(x))]
    layers.append(Line(ends, ends, "black", ADDED, 1.2, "4 3"))
    plot = Plot(f"added to the prediction [{unit}]", (Panel(f"residual [{unit}]", layers, 220),))
    words = "If the effect is real, the residual before follows the dashed line, and the residual after does not depend on it."
    return single(f"effect-{chapter.number}-own", "Residual over what the effect adds", words, plot)


def _means_plot(
    robot: Robot, chapter: Chapter, x_before: Sequence[Array], x_after: Sequence[Array], label: str
) -> Plot:
    j, view = chapter.joint, chapter.view
    after = kept(chapter.after, x_after, j)
    limits = middle_range(after)
    if view.signal == "reversal":
        # Most of the way to the next reversal has nothing to tell.
        far = SHOWN_DISTANCES * chapter.distance if chapter.distance else 0.0
        enough = float(np.quantile(after, min(1.0, MIN_SAMPLES / max(1, len(after)))))
        limits = (0.0, min(limits[1], max(far, enough)) or limits[1])
    layers: list[Layer] = []
    for traces, signals, color, name in (
        (chapter.before, x_before, "vermillion", "residual before"),
        (chapter.after, x_after, "blue", "residual after"),
    ):
        y = kept(traces, [trace.residual[j] * _direction(trace, j, view.along) for trace in traces], j)
        layers += mean_layers(binned_means(kept(traces, signals, j), y, limits, 30), color, name)
    added = chapter.added
    law = _law(chapter, after, limits)
    if added is not None:
        turned = [part * _direction(trace, j, view.along) for part, trace in zip(added, chapter.after, strict=True)]
        means = binned_means(after, kept(chapter.after, turned, j), limits, 30)
        layers.append(Line(means.x, means.y, "black", ADDED, 1.2, "4 3"))
    panels = [Panel(f"residual [{robot.torque_unit(j)}]", layers, 150 if law else 220)]
    if law:
        panels.insert(0, Panel(f"torque [{robot.torque_unit(j)}]", law, 150))
    return Plot(label, panels, limits)


def _law(chapter: Chapter, x: Array, limits: tuple[float, float]) -> list[Layer]:
    """The effect's torque over its signal, and what measured torque leaves to it."""
    j, own, view = chapter.joint, chapter.own, chapter.view
    if own is None:
        return []

    def means(signals: Sequence[Array]) -> Means:
        turned = [part * _direction(trace, j, view.along) for part, trace in zip(signals, chapter.after, strict=True)]
        return binned_means(x, kept(chapter.after, turned, j), limits, 30)

    left = means([part + trace.residual[j] for part, trace in zip(own, chapter.after, strict=True)])
    law = means(own)
    return [*mean_layers(left, "green", LEFT), Line(law.x, law.y, "black", LAW, 1.2, "2 3")]


def _direction(trace: Trace, j: int, along: bool) -> Array | float:
    return np.sign(trace.motion.v[j]) if along else 1.0


def _by_order(robot: Robot, chapter: Chapter, name: str, unit: str) -> Figure | None:
    layers: list[Layer] = []
    for traces, color, words in ((chapter.before, "vermillion", "before"), (chapter.after, "blue", "after")):
        found = orders(robot, traces, chapter.joint, [trace.residual[chapter.joint] for trace in traces])
        if found is None:
            return None
        layers.append(Line(found.order, found.amplitude, color, f"residual {words}"))
    plot = Plot("order [1 / motor turn]", (Panel(f"amplitude [{unit}]", layers, 220),))
    return single(name, f"{robot.joints[chapter.joint]}: what repeats with the motor's turn", ORDER_WORDS, plot)


def _by_frequency(chapter: Chapter, name: str, unit: str) -> Figure | None:
    layers: list[Layer] = []
    for traces, color, words in ((chapter.before, "vermillion", "before"), (chapter.after, "blue", "after")):
        found = spectrum([(trace.raw_residual[chapter.joint, trace.core], trace.motion.rate) for trace in traces])
        if found is None:
            return None
        layers.append(Line(found.frequency, found.highest, color, f"residual {words}"))
    plot = Plot("frequency [Hz]", (Panel(f"density [{unit}/√Hz]", layers, 220, log=True),), log=True)
    return single(name, "Spectrum over frequency", "Highest line of each bin, unfiltered.", plot)
