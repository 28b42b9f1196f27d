"""The report of an excitation trajectory: the motion within its limits, and the moving arm."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident.manners import several
from scara_ident.motion.motion import Motion
from scara_ident.report.html.blocks import (
    Beside,
    Block,
    Cell,
    Group,
    Paragraph,
    Table,
    Tag,
    information_words,
    name,
    number,
    superscripts,
)
from scara_ident.report.html.moving_arm import moving_arm
from scara_ident.report.html.page import Page, parts
from scara_ident.report.html.section import NamedSection, Section, notes_section
from scara_ident.report.plot import Figure, Grid, Layer, Level, Line, Mark, Panel, Plot, single
from scara_ident.robot.robot import Robot

# Points at which a motion is drawn, at the most.
MAX_POINTS = 4000


@dataclass(frozen=True, eq=False)
class ExcitationContext:
    """What the sections of an excitation draw from.

    Attributes
    ----------
    content : mapping
        The content of ``excitation.json``.
    motions : sequence of Motion
        The trajectories; torque, where there is one, is what the design expects.
    """

    content: Mapping[str, Any]
    robot: Robot
    motions: Sequence[Motion]

    @property
    def limits(self) -> list[tuple[str, Mapping[str, Any]]]:
        """Name of every limit with its bound, what is reached of it, the share and the unit."""
        return list(_bounded(self.content.get("limits") or {}))


def _motion(k: int, context: ExcitationContext) -> list[Block]:
    """One trajectory: the moving arm, states that the data will cover, and signals over time."""
    robot, motion = context.robot, context.motions[k]
    bounds = {limit: float(each["bound"]) for limit, each in context.limits if each.get("bound") is not None}
    figures = [_joint_figure(robot, motion, j, k, bounds) for j in range(robot.n)]
    covers = [_cover_figure(robot, motion, j, k, bounds) for j in range(robot.n)]
    torque = "" if motion.torque is None else " The torque is the one that the design predicts."
    cover = Group(f"cover-group-{k}", covers, (), "two" if robot.n > 2 else "")
    arm = moving_arm(robot, motion, f"arm-{k}")
    return [
        *((arm, cover) if arm.spatial else (Beside((arm, cover)),)),
        Paragraph(f"Over time; dashed: the limits.{torque}"),
        Group(f"motion-group-{k}", figures, (), "two"),
    ]


def _limits(context: ExcitationContext) -> list[Block]:
    """What the motion reaches of each limit."""
    rows: list[list[Cell | str]] = []
    for limit, each in context.limits:
        share = each.get("share")
        tag = Tag("broken", "bad") if (share or 0.0) > 1.0 else None
        used = Cell("" if share is None else f"{share:.0%}", track=share, tag=tag)
        unit = superscripts(str(each.get("unit", "")))
        rows.append([name(limit), number(each.get("reached")), number(each.get("bound")), unit, used])
    words = Paragraph(
        "How much of each limit the motion uses, also between its samples; for a position, the share of the distance from the middle of the range to its end."
    )
    return [words, Table(("limit", "reached", "bound", "unit", "used"), rows, (1, 2))] if rows else []


def _information(context: ExcitationContext) -> list[Block]:
    """The two criteria of a motion."""
    log_det, condition = (context.content.get(key) for key in ("log_det", "condition"))
    return [] if log_det is None else [Paragraph(information_words(log_det, condition))]


def excitation_report(path: Path, content: Mapping[str, Any], robot: Robot, motions: Sequence[Motion]) -> None:
    """Write the report of designed trajectories as one HTML file; arguments are those of `ExcitationContext`.

    Raises
    ------
    ScaraIdentError
        If the file cannot be written.
    """
    context = ExcitationContext(content, robot, motions)
    broken = [limit for limit, each in context.limits if (each.get("share") or 0.0) > 1.0]
    # The numbers of its information have a section of their own, which explains them.
    said = [each for each in content.get("summary") or () if not each.startswith("Information of")]
    verdict = said or [
        f"A motion of {number(content.get('duration'))} s.",
        f"Broken limits: {', '.join(broken)}." if broken else "All limits hold.",
    ]
    sections: list[Section] = [
        NamedSection(f"motion-{k}", "Motion" if len(motions) == 1 else f"Motion {motion.name}", partial(_motion, k))
        for k, motion in enumerate(motions)
    ]
    trajectories = several(len(motions), "trajectory").replace("trajectorys", "trajectories")
    subtitle = f"{trajectories} of {content.get('duration') or 0.0:g} s for {several(robot.n, 'joint')}"
    if content.get("harmonics"):
        subtitle += f"; {several(content['harmonics'], 'harmonic')}"
    if content.get("model"):
        subtitle += f"; parameters of the {content['model']} model"
    sections += [NamedSection("limits", "Limits", _limits), NamedSection("information", "Information", _information)]
    sections.append(notes_section(lambda context: context.content.get("notes"), "Notes"))
    found = parts("excitation", sections, context)
    Page(f"Excitation of {robot.name}", subtitle, verdict, found, bool(broken)).write(path)


def _joint_figure(robot: Robot, motion: Motion, j: int, place: int, bounds: Mapping[str, float]) -> Figure:
    every = max(1, motion.samples // MAX_POINTS)
    grid = Grid(float(motion.time[0]), every / motion.rate, -(-motion.samples // every))
    length = robot.position_unit(j)
    lower, upper, speed, torque = _joint_limits(robot, j, bounds)
    panels = []
    for label, signal, ends in (
        (f"position [{length}]", motion.q[j], (lower, upper)),
        (f"velocity [{length}/s]", motion.v[j], (-speed, speed)),
        (f"acc. [{length}/s²]", motion.a[j], ()),
        (f"torque [{robot.torque_unit(j)}]", None if motion.torque is None else motion.torque[j], (-torque, torque)),
    ):  # fmt: skip
        if signal is None:
            continue
        layers: list[Layer] = [Line(grid, signal[::every], "blue", label.split(" [")[0], 1.5)]
        layers += [Level(bound, "vermillion", "limit") for bound in ends if np.isfinite(bound)]
        panels.append(Panel(label, layers, 110))
    return single(f"motion-{place}-{j}", robot.joints[j], "", Plot("time [s]", panels), quiet=True)


def _cover_figure(robot: Robot, motion: Motion, j: int, place: int, bounds: Mapping[str, float]) -> Figure:
    length = robot.position_unit(j)
    every = max(1, motion.samples // MAX_POINTS)
    layers: list[Layer] = [Line(motion.q[j, ::every], motion.v[j, ::every], "blue", path=True)]
    lower, upper, speed, _ = _joint_limits(robot, j, bounds)
    ends = [end for end in (lower, upper) if np.isfinite(end)]
    layers += [Mark(end, "vermillion") for end in ends]
    layers += [Level(end, "vermillion") for end in (-speed, speed) if np.isfinite(end)]
    reach = [*ends, float(np.min(motion.q[j])), float(np.max(motion.q[j]))]
    # A limit far beyond the motion, such as that of an endless joint, is not worth the room.
    span = float(np.ptp(motion.q[j])) or 1.0
    low, high = max(min(reach), reach[-2] - span), min(max(reach), reach[-1] + span)
    limits = (low - 0.03 * (high - low), high + 0.03 * (high - low))
    plot = Plot(f"position [{length}]", (Panel(f"velocity [{length}/s]", layers, 170),), limits, small=True)
    title = f"{robot.joints[j]}: states that the data will cover"
    return single(f"cover-{place}-{j}", title, "", plot, quiet=True)


def _joint_limits(robot: Robot, j: int, bounds: Mapping[str, float]) -> tuple[float, float, float, float]:
    """Lower and upper position, velocity and torque that the design kept to; the URDF's where it does not say."""
    kinds = (
        ("position.lower", robot.lower),
        ("position.upper", robot.upper),
        ("velocity", robot.velocity_limit),
        ("torque", robot.torque_limit),
    )
    lower, upper, speed, torque = (bounds.get(f"{robot.joints[j]}.{kind}", float(own[j])) for kind, own in kinds)
    return lower, upper, speed, torque


def _bounded(limits: Mapping[str, Any], name: str = "") -> Iterator[tuple[str, Mapping[str, Any]]]:
    if "bound" in limits:
        yield name, limits
        return
    for key, item in limits.items():
        if isinstance(item, Mapping):
            yield from _bounded(item, f"{name}.{key}" if name else key)
