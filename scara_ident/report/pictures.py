"""The pictures beside the reports: torque of an identification, effects of a diagnosis, motion of a design."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from scara_ident.arrays import Array
from scara_ident.report.drawing import draw, drawn
from scara_ident.report.html.diagnosis import DiagnosisContext
from scara_ident.report.html.identification import IdentificationContext
from scara_ident.report.html.moving_arm import ROUNDING
from scara_ident.report.html.remainder import remainder_group
from scara_ident.report.html.story import chapter_group, moment_group
from scara_ident.report.html.torque import torque_plot
from scara_ident.report.plot import DASHES, Dots, Figure, Layer, Line, Panel, Plot, single, style
from scara_ident.report.traces import FittedContext
from scara_ident.robot.robot import Robot
from scara_ident.threads import one_blas_thread

if TYPE_CHECKING:
    from scara_ident.excitation.curves import ExcitationTrajectory
    from scara_ident.excitation.design import Design

# Recordings shown, at the most; the first held-out ones before the fitted ones.
MAX_RECORDINGS = 4
# Pixels of the page that the torque of a joint has.
HEIGHT = 170
# Points of a designed motion.
POINTS = 3000


def torque_picture(path: Path, context: IdentificationContext) -> None:
    """Draw measured, predicted and residual torque over time, a column per recording and a row per joint.

    Parameters
    ----------
    path : Path
        PNG file.
    context : IdentificationContext

    Raises
    ------
    ScaraIdentError
        If the file cannot be written.
    """
    found = context.identification
    draw(path, *torque_figures(context, found.model.robot, found.bands))


def torque_figures(
    context: FittedContext, robot: Robot, bands: Sequence[float | None]
) -> tuple[str, list[list[Figure]]]:
    """Return title and rows of the picture of torque over time, see `torque_picture`."""
    rows: list[list[Figure]] = []
    for j, joint in enumerate(robot.joints):
        rows.append([])
        for name, traces in context.parts[:MAX_RECORDINGS]:
            plot = torque_plot(robot, traces, j, bands[j])
            # Residual and torque over one axis: axes are what takes the time.
            panel = Panel(plot.panels[0].label, [layer for each in plot.panels for layer in each.layers], HEIGHT)
            rows[-1].append(single("torque", f"{name}, {joint}", "", replace(plot, panels=(panel,))))
    return "Measured and predicted torque", rows


@dataclass(frozen=True)
class Picture:
    """A picture beside a report: its title, the name of its file, and what that holds."""

    title: str
    name: str
    content: bytes


def diagnosis_pictures(context: DiagnosisContext) -> tuple[Picture, ...]:
    """Draw every effect found, and what no effect accounts for, as PNG files.

    Parameters
    ----------
    context : DiagnosisContext
    """
    return tuple(Picture(title, name, drawn(title, rows)) for title, name, rows in effect_figures(context))


def effect_figures(context: DiagnosisContext) -> list[tuple[str, str, list[Sequence[Figure]]]]:
    """Return title, file name and rows of the picture of every effect found, and of what no effect accounts for."""
    robot, remainder = context.diagnosis.robot, context.diagnosis.unexplained
    found: list[tuple[str, str, list[Sequence[Figure]]]] = []
    with one_blas_thread():
        for effect, chapter in context.chapters:
            rows: list[Sequence[Figure]] = [chapter_group(robot, chapter).figures, moment_group(robot, chapter).figures]
            found.append((effect.title, f"effect_{chapter.number}.png", rows))
        group = None if remainder is None else remainder_group(robot, remainder, context.sets["training"])
        if remainder is not None and group is not None:
            title = f"What no effect explains on {remainder.joint}"
            found.append((title, "unexplained.png", [group.figures]))
    return found


def remove_stale(folder: Path, written: Sequence[str]) -> None:
    """Remove pictures that an earlier diagnosis left in a folder, so that they are not taken for this one's.

    Parameters
    ----------
    folder : Path
    written : sequence of str
        Names of this diagnosis' pictures.
    """
    for old in (*folder.glob("effect_*.png"), folder / "unexplained.png"):
        if old.name not in written:
            old.unlink(missing_ok=True)


def design_picture(path: Path, design: Design) -> None:
    """Draw a design.

    Joint positions in time, velocity over position of every joint with its limits, the tool's path in
    its plane or from above and from the side, and every parameter's std per unit of torque noise: with all parameters
    estimated, beside that with all others known, or beside what was known before.

    Parameters
    ----------
    path : Path
        PNG, SVG or PDF file.
    design : Design

    Raises
    ------
    ScaraIdentError
        If the file cannot be written or the suffix is of no picture.
    """
    draw(path, *design_figures(design))


def design_figures(design: Design) -> tuple[str, list[list[Figure]]]:
    """Return title and rows of the picture of a design, see `design_picture`."""
    names = ", ".join(each.name for each in design.trajectories)
    title = (
        f"{design.model.robot.name}: {names} - J_d = ln det H^T H {design.log_det:.2f}, "
        f"J_k = cond H^T H {design.condition:.4g} ({design.model.name} model)"
    )
    return title, [[_motion(design), _phases(design)], _paths(design), [_parameters(design)]]


def _times(trajectory: ExcitationTrajectory) -> Array:
    return np.linspace(0.0, trajectory.duration, POINTS)


def _motion(design: Design) -> Figure:
    layers: list[Layer] = [
        Line(time, q, style(j)[0], trajectory.joints[j] if k == 0 else "", 1.5, DASHES[k % len(DASHES)])
        for k, trajectory in enumerate(design.trajectories)
        for time in [_times(trajectory)]
        for j, q in enumerate(trajectory.at(time)[0])
    ]
    robot = design.model.robot
    units = " or ".join(dict.fromkeys(map(robot.position_unit, range(robot.n))))
    return single("motion", "Motion", "", Plot("time [s]", (Panel(f"position [{units}]", layers, 260),)))


def _phases(design: Design) -> Figure:
    limits = design.limits
    half = 0.5 * (limits.upper - limits.lower)
    box = Line([-1.0, 1.0, 1.0, -1.0, -1.0], [-1.0, -1.0, 1.0, 1.0, -1.0], "grey", "", 1.2, "5 3", path=True)
    layers: list[Layer] = [box]
    for trajectory in design.trajectories:
        for j, (q, v) in enumerate(zip(*trajectory.at(_times(trajectory))[:2], strict=True)):
            place = (q - limits.centre[j]) / half[j]
            layers.append(Line(place, v / limits.velocity[j], style(j)[0], "", 1.0, path=True))
    panel = Panel("velocity, share of the limit", layers, 260)
    return single("phases", "Phase portraits and limits", "", Plot("position, share of the range", (panel,)))


def _paths(design: Design) -> list[Figure]:
    # Loaded where a design is drawn: searches for motions take long to load.
    from scara_ident.excitation.tool import tool_motion, tool_of

    tool = design.limits.tool or tool_of(design.model.robot)
    return path_views([tool_motion(tool, *each.at(_times(each))).position for each in design.trajectories], tool.name)


def path_views(paths: Sequence[Array], tool: str) -> list[Figure]:
    """Return a path in its plane, or one that leaves it from above and from the side.

    Parameters
    ----------
    paths : sequence of ndarray, shape (3, N)
        m.
    tool : str
    """
    reach = np.ptp(np.concatenate(paths, axis=1), axis=1)
    side = 0 if reach[0] >= reach[1] else 1
    flat = sorted(np.argsort(reach, kind="stable")[1:].tolist())
    views = [("", *flat)]
    if min(reach) > ROUNDING * max(reach):
        views = [(" from above", 0, 1), (" from the side", side, 2)]
    found = []
    for words, first, second in views:
        layers: list[Layer] = []
        for k, path in enumerate(paths):
            layers.append(Line(path[first], path[second], "blue", "", 1.0, DASHES[k % len(DASHES)], path=True))
            layers.append(Dots(path[first, :1], path[second, :1], "blue", radius=5.0))
        plot = Plot(f"{'xyz'[first]} [m]", (Panel(f"{'xyz'[second]} [m]", layers, 300),), equal=True)
        found.append(single(f"path-{first}{second}", f"Path of {tool}{words} (dot: start)", "", plot))
    return found


def _parameters(design: Design) -> Figure:
    together = design.std()
    if design.prior is None:
        size = np.linalg.norm(design.information.regressor_factor, axis=0)
        other = np.divide(1.0, size, out=np.full(len(size), np.inf), where=size > 0.0)
        labels = ("all parameters estimated", "all others known")
    else:
        other = design.prior.std()
        labels = ("after", "before")
    places = np.arange(float(len(together)))
    layers: list[Layer] = [
        Dots(places, np.where(np.isfinite(values), values, np.nan), color, label, radius=size)
        for values, label, color, size in ((other, labels[1], "sky", 6.0), (together, labels[0], "blue", 4.0))
    ]
    unit = "" if np.any(design.weights != 1.0) else " per unit of torque noise"
    panel = Panel("std [the parameter's unit]", layers, 260, log=True)
    return single("std", f"Parameters: std{unit}", "", Plot("", (panel,), names=design.model.names))
