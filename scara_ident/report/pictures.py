"""The figures of a diagnosis as PNG files beside its Markdown: residuals over what explains them, before and after."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np

from scara_ident.diagnosis import Diagnosis
from scara_ident.files import write_whole
from scara_ident.recording.recording import Recording
from scara_ident.report.html.chapters import chapters
from scara_ident.report.html.plot import (
    Band,
    Density,
    Dots,
    Figure,
    Grid,
    Layer,
    Level,
    Line,
    Mark,
    Matrix,
    Panel,
    Plot,
    Region,
)
from scara_ident.report.html.remainder import remainder_group
from scara_ident.report.html.story import chapter_group, moment_group
from scara_ident.report.html.traces import traces
from scara_ident.threads import one_blas_thread

COLORS = {
    "blue": "#0072b2",
    "vermillion": "#d55e00",
    "green": "#009e73",
    "orange": "#e69f00",
    "sky": "#56b4e9",
    "purple": "#cc79a7",
    "black": "#1b1f24",
    "grey": "#9aa3ad",
}
WIDTH = 10.0
DPI = 110


def diagnosis_pictures(
    folder: Path, diagnosis: Diagnosis, recordings: Sequence[Recording]
) -> tuple[tuple[str, str], ...]:
    """Draw every effect found, and what no effect accounts for.

    Parameters
    ----------
    folder : Path
        Where the PNG files are written.
    diagnosis : Diagnosis
    recordings : sequence of Recording
        Those that every choice was made on, as they were given.

    Returns
    -------
    tuple of (str, str)
        Title and file name of each.

    Raises
    ------
    ScaraIdentError
        If a file cannot be written.
    """
    robot, search = diagnosis.robot, diagnosis.search
    found: list[tuple[str, str]] = []
    with one_blas_thread():
        for effect, chapter in chapters(diagnosis, recordings):
            title = effect.effect if effect.joint is None else f"{effect.effect} on {effect.joint}"
            name = f"effect_{chapter.number}.png"
            above, below = chapter_group(robot, chapter).figures, moment_group(robot, chapter).figures
            _write(folder / name, title, above, below)
            found.append((title, name))
        if diagnosis.unexplained is not None:
            left = [traces(diagnosis.after.model, diagnosis.after.value, r, search.bands) for r in search.recordings]
            group = remainder_group(robot, diagnosis.unexplained, list(chain.from_iterable(left)))
            if group is not None:
                title = f"what no effect accounts for on {diagnosis.unexplained.joint}"
                _write(folder / "unexplained.png", title, group.figures, ())
                found.append((title, "unexplained.png"))
    return tuple(found)


def _write(path: Path, title: str, above: Sequence[Figure], below: Sequence[Figure]) -> None:
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    heights = ([3.9] if above else []) + [2.6] * len(below)
    figure = pyplot.figure(figsize=(WIDTH, sum(heights) + 0.4), layout="constrained")
    figure.suptitle(title, fontsize=11)
    strips = np.atleast_1d(figure.subfigures(len(heights), 1, height_ratios=heights))
    if above:
        for part, each in zip(np.atleast_1d(strips[0].subfigures(1, len(above))), above, strict=True):
            _draw(part, each)
    for part, each in zip(strips[1 if above else 0 :], below, strict=True):
        _draw(part, each)
    write_whole(path, lambda place: figure.savefig(place, dpi=DPI))
    pyplot.close(figure)


def _draw(part: Any, figure: Figure) -> None:
    (drawing,) = figure.variants.values()
    part.suptitle(figure.title, fontsize=9)
    if isinstance(drawing, Matrix):
        _draw_matrix(part, drawing)
        return
    axes = np.atleast_1d(part.subplots(len(drawing.panels), 1, sharex=True))
    for axis, panel in zip(axes, drawing.panels, strict=True):
        _draw_panel(axis, panel, drawing)
    axes[-1].set_xlabel(drawing.x_label, fontsize=8)
    handles: dict[str, Any] = {}
    for axis in axes:
        handles |= dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True))
    part.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=2, fontsize=7, frameon=False)


def _draw_panel(axis: Any, panel: Panel, plot: Plot) -> None:
    if panel.log:
        axis.set_yscale("log")
    if plot.log:
        axis.set_xscale("log")
    fitted = [layer for layer in panel.layers if getattr(layer, "fit", True)]
    for layer in fitted:
        _draw_layer(axis, layer)
    if plot.limits is not None:
        axis.set_xlim(*plot.limits)
    if panel.limits is not None:
        axis.set_ylim(*panel.limits)
    # Limits are found only when asked for; from here on they stay.
    axis.autoscale_view()
    axis.autoscale(False)
    for layer in panel.layers:
        if layer not in fitted:
            _draw_layer(axis, layer)
    if not panel.log:
        axis.axhline(0.0, color="0.5", lw=0.5, zorder=0)
    axis.set_ylabel(panel.label, fontsize=8)
    axis.tick_params(labelsize=7)
    axis.grid(color="0.92", lw=0.6)
    axis.set_axisbelow(True)


def _along(x: Any) -> Any:
    return x.start + x.step * np.arange(x.count) if isinstance(x, Grid) else np.asarray(x, dtype=float)


def _draw_layer(axis: Any, layer: Layer) -> None:
    name = getattr(layer, "name", "") or None
    color = COLORS[str(getattr(layer, "color", "black"))]
    if isinstance(layer, Line):
        dash: Any = (0, tuple(float(x) for x in layer.dash.split())) if layer.dash else "-"
        axis.plot(_along(layer.x), np.asarray(layer.y), color=color, lw=0.8 * layer.width, ls=dash, label=name)
    elif isinstance(layer, Band):
        axis.fill_between(_along(layer.x), layer.low, layer.high, color=color, alpha=0.22, lw=0.0, label=name)
    elif isinstance(layer, Dots):
        axis.errorbar(layer.x, layer.y, yerr=layer.bar, fmt="o", ms=layer.radius, color=color, label=name)
    elif isinstance(layer, Density):
        counts = np.log1p(layer.counts.T)
        shade = np.zeros((*counts.shape, 4))
        shade[..., :3] = [int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]
        shade[..., 3] = 0.85 * counts / max(float(counts.max()), 1e-12)
        axis.imshow(shade, extent=(*layer.x, *layer.y), origin="lower", aspect="auto", interpolation="nearest")
    elif isinstance(layer, Region):
        axis.axvspan(*layer.x, ymax=layer.share, color=color, alpha=layer.opacity, lw=0.0, label=name)
    elif isinstance(layer, Level):
        axis.axhline(layer.y, color=color, lw=0.8, ls="--", label=name)
    elif isinstance(layer, Mark):
        axis.axvline(layer.x, color=color, lw=0.8, ls="--")


def _draw_matrix(part: Any, matrix: Matrix) -> None:
    axis = part.subplots()
    from matplotlib.colors import LinearSegmentedColormap

    colours = LinearSegmentedColormap.from_list("signs", [COLORS["vermillion"], "white", COLORS["blue"]])
    image = axis.imshow(matrix.values, cmap=colours, vmin=-matrix.most, vmax=matrix.most, aspect="auto")
    for set_ticks, labels in ((axis.set_xticks, matrix.columns), (axis.set_yticks, matrix.rows)):
        every = max(1, len(labels) // 4)
        set_ticks(range(0, len(labels), every), list(labels)[::every], fontsize=7)
    axis.set_xlabel(matrix.column_label, fontsize=8)
    axis.set_ylabel(matrix.row_label, fontsize=8)
    part.colorbar(image, ax=axis).ax.tick_params(labelsize=7)


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
