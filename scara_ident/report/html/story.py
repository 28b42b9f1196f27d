"""The figures that show one effect: the residual before and after it came in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.diagnosis.search import DELAY
from scara_ident.report.html.bins import binned_means, middle_range
from scara_ident.report.html.page import Group
from scara_ident.report.html.plot import Band, Figure, Layer, Line, Panel, Plot, single
from scara_ident.report.html.spectra import orders, spectrum
from scara_ident.report.html.torque import banded
from scara_ident.report.html.traces import Trace, kept
from scara_ident.robot import Robot

Array = NDArray[np.float64]


@dataclass(frozen=True)
class View:
    """The signal over which an effect shows itself, and whether the residual is taken in the direction of motion."""

    label: str
    signal: Callable[[Robot, Trace, int], Array]
    along: bool = False
    share: float = 0.995


def _since_reversal(robot: Robot, trace: Trace, j: int) -> Array:
    turns = np.flatnonzero(np.diff(np.sign(trace.motion.v[j]))) + 1
    last = np.zeros(trace.motion.samples, dtype=int)
    last[turns] = turns
    q = trace.motion.q[j]
    return np.asarray(np.abs(q - q[np.maximum.accumulate(last)]))


POSITION = View("position", lambda robot, trace, j: trace.motion.q[j])
VELOCITY = View("velocity", lambda robot, trace, j: trace.motion.v[j])
TIME = View("time since the start [s]", lambda robot, trace, j: trace.time)
TORQUE = View("predicted torque", lambda robot, trace, j: trace.predicted[j])
REVERSAL = View("travel since the last reversal", _since_reversal, along=True, share=0.4)
VIEWS = {
    "spring": POSITION,
    "base_tilt": POSITION,
    "position_dependent_friction": View("position", POSITION.signal, along=True),
    "stribeck": VELOCITY,
    "asymmetric_friction": VELOCITY,
    "warm_up": View("time since the start [s]", TIME.signal, along=True),
    "offset_drift": TIME,
    "payload_change": TIME,
    "torque_sensor_nonlinearity": TORQUE,
    "torque_gain_mismatch": TORQUE,
    "transmission_loss": View("size of the load", lambda robot, trace, j: np.abs(trace.load[j]), along=True),
    "presliding": REVERSAL,
    "backlash": REVERSAL,
    "joint_elasticity": View("acceleration", lambda robot, trace, j: trace.motion.a[j]),
    "time_delay": View(
        "rate of the predicted torque", lambda robot, trace, j: np.gradient(trace.predicted[j]) * trace.motion.rate
    ),
}
ADDED = "what it adds to the prediction"
BY_ORDER = ("torque_ripple", "encoder_eccentricity")
BY_FREQUENCY = ("vibration",)


@dataclass(frozen=True, eq=False)
class Chapter:
    """One effect with the residual before and after it.

    Attributes
    ----------
    number : int
    effect : str
    joint : int
        The joint whose residual is shown.
    before, after : sequence of Trace
        Of the same recordings in the same order.
    bands : sequence of float or None
    """

    number: int
    effect: str
    joint: int
    before: Sequence[Trace]
    after: Sequence[Trace]
    bands: Sequence[float | None]

    @property
    def added(self) -> list[Array] | None:
        """What the effect adds to the prediction, net of what the other parameters give back, (N,) per part.

        None for an effect that was corrected in the data, which changes no prediction.
        """
        if self.effect == DELAY:
            return None
        return [
            after.predicted[self.joint] - before.predicted[self.joint]
            for before, after in zip(self.before, self.after, strict=True)
        ]


def chapter_group(robot: Robot, chapter: Chapter) -> Group:
    """Return the figures that show an effect before and after."""
    figures = [figure for figure in (_telling(robot, chapter), _own(robot, chapter)) if figure]
    return Group(f"effect-{chapter.number}", figures, (), "two")


def moment_group(robot: Robot, chapter: Chapter) -> Group:
    """Return the residual over time before and after on the recording where the effect is strongest."""
    j, added = chapter.joint, chapter.added
    gains = [_squares(a, j) - _squares(b, j) for a, b in zip(chapter.before, chapter.after, strict=True)]
    k = int(np.argmax(gains))
    before, after = chapter.before[k], chapter.after[k]
    layers: list[Layer] = []
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
    return float(np.sum(trace.residual[j][trace.used[j]] ** 2)) / max(1, trace.motion.samples)


def _telling(robot: Robot, chapter: Chapter) -> Figure | None:
    name, unit = f"effect-{chapter.number}-view", robot.torque_unit(chapter.joint)
    if chapter.effect in BY_ORDER:
        return _by_order(robot, chapter, name, unit)
    if chapter.effect in BY_FREQUENCY:
        return _by_frequency(chapter, name, unit)
    view = VIEWS.get(chapter.effect)
    if view is None:
        return None
    j = chapter.joint
    plots = [[view.signal(robot, trace, j) for trace in traces] for traces in (chapter.before, chapter.after)]
    plot = _means_plot(robot, chapter, plots[0], plots[1], _with_unit(robot, view, j), view)
    words = (
        "Means with two standard errors; residual in the direction of motion."
        if view.along
        else "Means with two standard errors."
    )
    return single(name, f"{robot.joints[j]}: residual over {view.label.split(' [')[0]}", words, plot)


def _own(robot: Robot, chapter: Chapter) -> Figure | None:
    added = chapter.added
    if added is None:
        return None
    label = f"added to the prediction [{robot.torque_unit(chapter.joint)}]"
    plot = _means_plot(robot, chapter, added, added, label, View(label, TORQUE.signal))
    words = "If the effect is real, the residual before follows the dashed line, and nothing of it is left after."
    return single(f"effect-{chapter.number}-own", "Residual over what the effect adds", words, plot)


def _means_plot(
    robot: Robot, chapter: Chapter, x_before: Sequence[Array], x_after: Sequence[Array], label: str, view: View
) -> Plot:
    j = chapter.joint
    limits = middle_range(kept(chapter.after, x_after, j), view.share)
    layers: list[Layer] = []
    for traces, signals, color, name in (
        (chapter.before, x_before, "vermillion", "residual before"),
        (chapter.after, x_after, "blue", "residual after"),
    ):
        y = kept(traces, [trace.residual[j] * _direction(trace, j, view.along) for trace in traces], j)
        means = binned_means(kept(traces, signals, j), y, limits, 30)
        layers.append(Band(means.x, means.y - 2.0 * means.error, means.y + 2.0 * means.error, color))
        layers.append(Line(means.x, means.y, color, name, 1.8))
    added = chapter.added
    if added is not None:
        turned = [part * _direction(trace, j, view.along) for part, trace in zip(added, chapter.after, strict=True)]
        means = binned_means(kept(chapter.after, x_after, j), kept(chapter.after, turned, j), limits, 30)
        layers.append(Line(means.x, means.y, "black", ADDED, 1.2, "4 3"))
    return Plot(label, (Panel(f"residual [{robot.torque_unit(j)}]", layers, 220),), limits)


def _direction(trace: Trace, j: int, along: bool) -> Array | float:
    return np.sign(trace.motion.v[j]) if along else 1.0


def _with_unit(robot: Robot, view: View, j: int) -> str:
    length = "m" if robot.prismatic[j] else "rad"
    torque = robot.torque_unit(j)
    units = {
        "position": length,
        "velocity": f"{length}/s",
        "acceleration": f"{length}/s²",
        "predicted torque": torque,
        "size of the load": torque,
        "travel since the last reversal": length,
        "rate of the predicted torque": f"{torque}/s",
    }
    return f"{view.label} [{units[view.label]}]" if view.label in units else view.label


def _by_order(robot: Robot, chapter: Chapter, name: str, unit: str) -> Figure | None:
    layers: list[Layer] = []
    for traces, color, words in ((chapter.before, "vermillion", "before"), (chapter.after, "blue", "after")):
        found = orders(robot, traces, chapter.joint, [trace.raw_residual[chapter.joint] for trace in traces])
        if found is None:
            return None
        layers.append(Line(found.order, found.amplitude, color, f"residual {words}"))
    plot = Plot("order [1 / motor turn]", (Panel(f"amplitude [{unit}]", layers, 220),))
    return single(name, f"{robot.joints[chapter.joint]}: what repeats with the motor's turn", "", plot)


def _by_frequency(chapter: Chapter, name: str, unit: str) -> Figure | None:
    layers: list[Layer] = []
    for traces, color, words in ((chapter.before, "vermillion", "before"), (chapter.after, "blue", "after")):
        found = spectrum([(trace.raw_residual[chapter.joint, trace.core], trace.motion.rate) for trace in traces])
        if found is None:
            return None
        layers.append(Line(found.frequency, found.highest, color, f"residual {words}"))
    plot = Plot("frequency [Hz]", (Panel(f"density [{unit}/√Hz]", layers, 220, log=True),), log=True)
    return single(name, "Spectrum over frequency", "", plot)
