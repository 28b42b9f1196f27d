"""The report of a check: whether a motion can be run, what limits it, and what it costs."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from scara_ident.manners import listed, several
from scara_ident.report.html.blocks import (
    Block,
    Cell,
    Group,
    Paragraph,
    Selector,
    Table,
    Tag,
    name,
    number,
    superscripts,
)
from scara_ident.report.html.page import Page, parts
from scara_ident.report.html.section import NamedSection
from scara_ident.report.plot import Figure, Layer, Level, Mark, Panel, Plot, single, style, thin_line
from scara_ident.use.check import CLOSE_STDS, Check, limits_of_joint, sentences
from scara_ident.use.energy import Energy

# Points of a line, at the most.
MAX_POINTS = 6000
# Share of a drive's work below which a part of it is rounding.
ROUNDING = 1e-9


def check_report(path: Path, found: Check) -> None:
    """Write the report of a check as one HTML file.

    Raises
    ------
    ScaraIdentError
        If the file cannot be written.
    """
    robot, said = found.known.robot, sentences(found)
    sections = (
        NamedSection("limits", "Limits", _limits),
        NamedSection("motion", "Motion and torque", _motion),
        NamedSection("energy", "Energy", _energy),
    )
    seconds = sum(float(np.ptp(each.motion.time)) for each in found.drives)
    subtitle = (
        f"{seconds:.4g} s for {several(robot.n, 'joint')}; torques predicted by the {found.known.model.name} model"
    )
    Page(f"Check of {found.name}", subtitle, said, parts("check", sections, found), bool(found.broken)).write(path)


def check_figures(found: Check) -> list[list[Figure]]:
    """Return what a still picture shows: torque and power of every joint, a row per joint."""
    return [
        [single(kind, f"{joint}: {kind}", "", Plot("time [s]", (_panel(found, j, kind, 150),))) for kind in _PICTURED]
        for j, joint in enumerate(found.known.robot.joints)
    ]


_PICTURED = ("torque", "power")
_KINDS = ("position", "velocity", "acceleration", "torque", "power")


def _limits(found: Check) -> list[Block]:
    """What is reached of each limit, and when."""
    rows: list[list[Cell | str]] = []
    std = {f"{each.joint}.torque": each.std for each in found.peaks}
    for each in found.margins:
        tag = None if each.kept else Tag("broken", "bad")
        used = Cell("" if each.share is None else f"{each.share:.0%}", track=each.share, tag=tag)
        unit = superscripts(each.unit)
        spans = listed([f"{start:.3f} to {stop:.3f}" for start, stop in each.beyond], 3)
        rows.append(
            [
                name(each.name),
                number(each.reached, 4),
                number(CLOSE_STDS * std[each.name], 2) if each.name in std else "",
                number(each.bound, 4),
                unit,
                f"{each.time:.3f}",
                used,
                spans,
            ]
        )
    head = ["limit", "reached", "±", "bound", "unit", "at [s]", "used", "beyond it [s]"]
    if not found.broken:
        head, rows = head[:-1], [row[:-1] for row in rows]
    words = "For each limit the value that is nearest to it or farthest beyond it. Torque is the torque of the drive, including its rotor, on the side where effort is recorded; ± is two standard deviations, from the parameters and the model's error on recordings. Used, for a position: the share of the distance from the middle of the range to its end."
    return [Paragraph(words), Table(head, rows, (1, 2, 3, 5))] if rows else []


def _motion(found: Check) -> list[Block]:
    """Signals of every joint over time, with their limits."""
    panels = [tuple(_panel(found, j, kind) for kind in _KINDS) for j in range(found.known.robot.n)]
    figure = Figure("signals", "Over time", "", {(j,): Plot("time [s]", each) for j, each in enumerate(panels)}, (0,))
    selector = Selector("joint", tuple(found.known.robot.joints))
    recorded = (
        " Thin: recorded torque, which is the effort in the file times its gain."
        if found.recorded_rms is not None
        else ""
    )
    return [Paragraph(f"Dashed: limits.{recorded}"), Group("signals-group", (figure,), (selector,))]


def _panel(found: Check, j: int, kind: str, height: int = 110) -> Panel:
    robot = found.known.robot
    length = robot.position_unit(j)
    unit = {
        "position": length,
        "velocity": f"{length}/s",
        "acceleration": f"{length}/s²",
        "torque": robot.torque_unit(j),
        "power": "W",
    }[kind]
    layers: list[Layer] = []
    for each in found.drives:
        motion = each.motion
        if kind == "torque" and motion.torque is not None:
            layers.append(thin_line(motion.time, motion.torque[j], MAX_POINTS, "grey", "recorded", 0.8))
        signal = {"position": motion.q, "velocity": motion.v, "acceleration": motion.a}.get(kind)
        own = (each.torque if kind == "torque" else each.power) if signal is None else signal
        layers.append(thin_line(motion.time, own[j], MAX_POINTS, "blue", kind))
    bounds = limits_of_joint(found.limits, j)[kind]
    layers += [Level(bound, "vermillion", "limit") for bound in bounds if np.isfinite(bound)]
    worst = found.limited_by
    if worst is not None and worst.joint == robot.joints[j] and worst.kind.startswith(kind):
        layers.append(Mark(worst.time, "vermillion", f"{worst.reached:.4g}"))
    return Panel(f"{'acc.' if kind == 'acceleration' else kind} [{unit}]", layers, height)


def _energy(found: Check) -> list[Block]:
    """What the drives give, take back and lose, by joint and by part of the torque."""
    robot, energy = found.known.robot, found.energy
    names = [each for each in energy.work if np.any(energy.work[each] != 0.0)]
    rows: list[Sequence[Cell | str]] = [
        [
            name(joint),
            number(energy.given[j]),
            number(energy.returned[j]),
            number(energy.heated[j]),
            *(number(_worth(float(energy.work[each][j]), float(energy.given[j]))) for each in names),
        ]
        for j, joint in enumerate(robot.joints)
    ]
    head = ("joint", "given [J]", "taken back [J]", "heat [J]", *(f"{each} [J]" for each in names))
    words = (
        f"At the drives' shafts, without losses of windings and electronics. Given minus taken back is the sum of the "
        f"parts on the right; {_heat_words(energy)}."
    )
    plot = Plot("time [s]", (Panel("given minus taken back [J]", _balances(found), 180),))
    figure = single("energy-time", "Energy of each drive over time", "", plot)
    return [Paragraph(words), Table(head, rows, tuple(range(1, len(head)))), Group("energy-group", (figure,))]


def _heat_words(energy: Energy) -> str:
    """Say which parts become heat, and why one of them may be negative."""
    if len(energy.heat) < 2:
        return f"of these {', '.join(energy.heat) or 'none'} becomes heat"
    negative = any(np.any(energy.work[each] < 0.0) for each in energy.heat)
    why = "; a negative one belongs to a friction curve, which only their sum describes" if negative else ""
    return f"of these the sum of {', '.join(energy.heat)} becomes heat{why}"


def _worth(work: float, given: float) -> float:
    """Return a work that is no mere rounding of the work given, or else 0."""
    return 0.0 if abs(work) < ROUNDING * abs(given) else work


def _balances(found: Check) -> list[Layer]:
    layers: list[Layer] = []
    for j, joint in enumerate(found.known.robot.joints):
        start, (color, dash) = 0.0, style(j)
        for each in found.drives:
            time, power = each.motion.time, each.power[j]
            steps = 0.5 * (power[1:] + power[:-1]) * np.diff(time)
            sums = start + np.concatenate([[0.0], np.cumsum(steps)])
            layers.append(thin_line(time, sums, MAX_POINTS, color, joint, 1.3, dash))
            start = float(sums[-1])
    return layers
