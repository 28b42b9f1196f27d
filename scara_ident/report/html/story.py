"""The figures that show one effect: the residual before and after it came in."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from scara_ident.effects import EffectTerm
from scara_ident.estimators import Estimate
from scara_ident.motion import low_pass
from scara_ident.report.html.bins import binned_means, middle_range
from scara_ident.report.html.page import Group
from scara_ident.report.html.plot import Band, Figure, Grid, Layer, Line, Panel, Plot, single
from scara_ident.report.html.spectra import orders, spectrum
from scara_ident.report.html.torque import DRAWN_PER_PERIOD
from scara_ident.report.html.traces import Trace
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
    term : EffectTerm or None
        None for an effect that is corrected in the data.
    estimate : Estimate
        With the effect.
    bands : sequence of float or None
    """

    number: int
    effect: str
    joint: int
    before: Sequence[Trace]
    after: Sequence[Trace]
    term: EffectTerm | None
    estimate: Estimate
    bands: Sequence[float | None]

    def torque(self, trace: Trace) -> Array | None:
        """Torque of the effect on the shown joint within the band, shape (N,)."""
        if self.term is None:
            return None
        value = self.estimate.value[self.estimate.model.place(self.term)]
        raw = self.term.regressor(trace.motion)[self.joint].T @ value
        return low_pass(raw, trace.motion.rate, self.bands[self.joint])


def chapter_group(robot: Robot, chapter: Chapter) -> Group:
    """Return the figures that show an effect before and after."""
    effects = [chapter.torque(trace) for trace in chapter.after]
    figures = [figure for figure in (_telling(robot, chapter, effects), _own(robot, chapter, effects)) if figure]
    return Group(f"effect-{chapter.number}", figures, (), "two")


def moment_group(robot: Robot, chapter: Chapter) -> Group:
    """Return the residual over time before and after on the recording where the effect is strongest."""
    j = chapter.joint
    gains = [float(np.mean(a.residual[j] ** 2) - np.mean(b.residual[j] ** 2)) for a, b in zip(chapter.before, chapter.after, strict=True)]
    k = int(np.argmax(gains))
    before, after = chapter.before[k], chapter.after[k]
    layers: list[Layer] = []
    effect = chapter.torque(after)
    for trace, signal, color, name, dash in (
        (before, before.residual[j], "vermillion", "residual before", ""),
        (after, after.residual[j], "blue", "residual after", ""),
        (after, effect, "black", "torque of the effect", "4 3"),
    ):
        if signal is None:
            continue
        band = chapter.bands[j]
        every = 1 if band is None else max(1, int(trace.motion.rate / (DRAWN_PER_PERIOD * band)))
        grid = Grid(float(trace.time[0]), every / trace.motion.rate, -(-len(signal) // every))
        layers.append(Line(grid, signal[::every], color, name, 1.3, dash))
    panel = Panel(f"torque [{robot.torque_unit(j)}]", layers, 190)
    title = f"{robot.joints[j]} on {after.recording}, where it removes most"
    return Group(f"effect-{chapter.number}-time", (single(f"effect-{chapter.number}-time", title, "", Plot("time [s]", (panel,))),))


def _telling(robot: Robot, chapter: Chapter, effects: Sequence[Array | None]) -> Figure | None:
    name, unit = f"effect-{chapter.number}-view", robot.torque_unit(chapter.joint)
    if chapter.effect in BY_ORDER:
        return _by_order(robot, chapter, name, unit)
    if chapter.effect in BY_FREQUENCY:
        return _by_frequency(chapter, name, unit)
    view = VIEWS.get(chapter.effect)
    if view is None:
        return None
    j = chapter.joint
    plot = _means_plot(
        robot, chapter, lambda trace: view.signal(robot, trace, j), effects, _with_unit(robot, view, j), view.along, view.share
    )
    words = "Means with two standard errors; residual in the direction of motion." if view.along else "Means with two standard errors."
    return single(name, f"{robot.joints[j]}: residual over {view.label.split(' [')[0]}", words, plot)


def _own(robot: Robot, chapter: Chapter, effects: Sequence[Array | None]) -> Figure | None:
    if chapter.term is None:
        return None
    places = {id(trace): k for k, trace in enumerate(chapter.after)}
    before = {id(trace): k for k, trace in enumerate(chapter.before)}

    def signal(trace: Trace) -> Array:
        effect = effects[places.get(id(trace), before.get(id(trace), 0))]
        assert effect is not None
        return effect[: trace.motion.samples]

    unit = robot.torque_unit(chapter.joint)
    plot = _means_plot(robot, chapter, signal, effects, f"torque of the effect [{unit}]", False, 0.995)
    words = "Before, the residual rises with the torque that the effect adds; after, nothing should be left of that."
    return single(f"effect-{chapter.number}-own", "Residual over the effect's own torque", words, plot)


def _means_plot(
    robot: Robot,
    chapter: Chapter,
    signal: Callable[[Trace], Array],
    effects: Sequence[Array | None],
    label: str,
    along: bool,
    share: float,
) -> Plot:
    j = chapter.joint
    x_after = _kept(chapter.after, j, signal)
    limits = middle_range(x_after, share)
    if along and share < 0.9:
        limits = (0.0, limits[1])
    layers: list[Layer] = []
    for traces, color, name in ((chapter.before, "vermillion", "before"), (chapter.after, "blue", "after")):
        y = _kept(traces, j, lambda trace: trace.residual[j] * _direction(trace, j, along))
        means = binned_means(_kept(traces, j, signal), y, limits, 30)
        layers.append(Band(means.x, means.y - 2.0 * means.error, means.y + 2.0 * means.error, color))
        layers.append(Line(means.x, means.y, color, f"residual {name}", 1.8))
    if chapter.term is not None:
        own = {id(trace): effect for trace, effect in zip(chapter.after, effects, strict=True)}
        y = _kept(chapter.after, j, lambda trace: own[id(trace)] * _direction(trace, j, along))
        means = binned_means(x_after, y, limits, 30)
        layers.append(Line(means.x, means.y, "black", "torque of the effect", 1.2, "4 3"))
    return Plot(label, (Panel(f"residual [{robot.torque_unit(j)}]", layers, 220),), limits)


def _direction(trace: Trace, j: int, along: bool) -> Array | float:
    return np.sign(trace.motion.v[j]) if along else 1.0


def _kept(traces: Sequence[Trace], j: int, signal: Callable[[Trace], Array]) -> Array:
    return np.concatenate([signal(trace)[:: trace.step[j]][trace.used[j, :: trace.step[j]]] for trace in traces])


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
