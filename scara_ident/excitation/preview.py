"""A figure of a design: motion, phase portraits, path of the tool, and what each parameter's std becomes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from scara_ident.errors import ScaraIdentError
from scara_ident.excitation.design import Design
from scara_ident.excitation.tool import tool_motion, tool_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Array = NDArray[np.float64]

POINTS = 3000
FULL, PALE, EDGE = "#2a6f97", "#a9d6e5", "#8d99ae"


def preview_figure(design: Design) -> Figure:
    """Draw a design.

    Parameters
    ----------
    design : Design

    Returns
    -------
    matplotlib.figure.Figure
        Joint positions in time, velocity over position of every joint with its limits, the tool's path in the two
        directions in which it reaches farthest, and every parameter's std per unit of torque noise: with all
        parameters estimated, beside that with all others known, or beside what was known before.
    """
    from matplotlib.figure import Figure

    bars = len(design.model.names)
    figure = Figure(figsize=(12.0, max(8.0, 5.0 + 0.09 * bars)), layout="constrained")
    axes = figure.subplots(2, 2)
    _motion(axes[0, 0], design)
    _phases(axes[0, 1], design)
    _path(axes[1, 0], design)
    _parameters(axes[1, 1], design)
    names = ", ".join(each.name for each in design.trajectories)
    figure.suptitle(
        f"{design.model.robot.name}: {names} - ln det {design.log_det:.2f}, "
        f"cond of the regressor {np.sqrt(design.condition):.3g} ({design.model.name} model)"
    )
    for place in axes.flat:
        place.spines[["top", "right"]].set_visible(False)
        place.grid(alpha=0.25)
    return figure


def write_preview(design: Design, path: Path | str) -> None:
    """Write the figure as PNG, SVG or PDF, by the suffix.

    Raises
    ------
    ScaraIdentError
        If the file cannot be written or the suffix is of no picture.
    """
    path = Path(path)
    figure = preview_figure(design)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=120)
    except (OSError, ValueError) as error:
        raise ScaraIdentError(f"{path}: cannot be written: {' '.join(str(error).split())}") from error


def _time(design: Design) -> Array:
    return np.linspace(0.0, design.trajectories[0].duration, POINTS)


def _colours(design: Design) -> list[Any]:
    from matplotlib import colormaps

    n = design.model.robot.n
    return [colormaps["viridis"](0.1 + 0.75 * j / max(1, n - 1)) for j in range(n)]


def _motion(axes: Axes, design: Design) -> None:
    time = _time(design)
    for k, trajectory in enumerate(design.trajectories):
        for joint, (q, colour) in enumerate(zip(trajectory.at(time)[0], _colours(design), strict=True)):
            label = trajectory.joints[joint] if k == 0 else None
            axes.plot(time, q, color=colour, lw=1.2, ls=("-", "--", ":")[k % 3], label=label)
    axes.set_xlabel("time [s]")
    axes.set_ylabel("position [rad or m]")
    axes.set_title("Motion", loc="left")
    axes.legend(fontsize="small", frameon=False, ncols=4, loc="lower left", bbox_to_anchor=(0.2, 1.0))


def _phases(axes: Axes, design: Design) -> None:
    limits, time = design.limits, _time(design)
    half = 0.5 * (limits.upper - limits.lower)
    for trajectory in design.trajectories:
        q, v, _ = trajectory.at(time)
        for joint, colour in enumerate(_colours(design)):
            place = (q[joint] - limits.centre[joint]) / half[joint]
            axes.plot(place, v[joint] / limits.velocity[joint], color=colour, lw=0.8)
    axes.plot([-1, 1, 1, -1, -1], [-1, -1, 1, 1, -1], color=EDGE, lw=1.0, ls="--")
    axes.set_xlabel("position, share of the range")
    axes.set_ylabel("velocity, share of the limit")
    axes.set_title("Phase portraits and limits", loc="left")


def _path(axes: Axes, design: Design) -> None:
    tool = design.limits.tool or tool_of(design.model.robot)
    paths = [tool_motion(tool, *each.at(_time(design))).position for each in design.trajectories]
    reach = np.ptp(np.concatenate(paths, axis=1), axis=1)
    first, second = sorted(np.argsort(reach, kind="stable")[1:])
    for k, path in enumerate(paths):
        axes.plot(path[first], path[second], color=FULL, lw=0.8, ls=("-", "--", ":")[k % 3])
        axes.plot(path[first, 0], path[second, 0], "o", color=FULL, ms=5)
    axes.set_aspect("equal", adjustable="datalim")
    axes.set_xlabel(f"{'xyz'[first]} [m]")
    axes.set_ylabel(f"{'xyz'[second]} [m]")
    axes.set_title(f"Path of {tool.name} (dot: start)", loc="left")


def _parameters(axes: Axes, design: Design) -> None:
    names = design.model.names
    together = design.std()
    if design.prior is None:
        size = np.linalg.norm(design.information.regressor_factor, axis=0)
        other = np.divide(1.0, size, out=np.full(len(size), np.inf), where=size > 0.0)
        labels = ("all parameters estimated", "all others known")
    else:
        variance = np.diag(design.prior.inverse()).copy()
        variance[design.prior.solve().undetermined] = np.inf
        other = np.sqrt(variance)
        labels = ("after", "before")
    rows = np.arange(len(names))
    for values, label, colour, height in ((other, labels[1], PALE, 0.85), (together, labels[0], FULL, 0.45)):
        shown = np.isfinite(values)
        axes.plot(values[shown], rows[shown], "o" if height < 0.5 else "D", color=colour, ms=6, label=label)
    both = np.isfinite(other) & np.isfinite(together)
    axes.hlines(rows[both], np.minimum(other, together)[both], np.maximum(other, together)[both], color=EDGE, lw=1.0)
    axes.set_xscale("log")
    axes.set_yticks(rows, names, fontsize="small" if len(names) < 30 else 5)
    axes.invert_yaxis()
    unit = "" if np.any(design.weights != 1.0) else " per unit of torque noise"
    axes.set_xlabel(f"std{unit} (in the parameter's unit)")
    axes.set_title("Parameters", loc="left")
    axes.legend(fontsize="small", frameon=False, loc="best")
