"""The drawer of still pictures: figures, as the page has them, as PNG files."""

from __future__ import annotations

from collections.abc import Sequence
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from scara_ident.errors import ScaraIdentError
from scara_ident.files import write_whole
from scara_ident.report.plot import (
    Band,
    Density,
    Dots,
    Drawing,
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

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

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
DPI = 110
# In inches: least width of a picture and of a figure, a pixel of the page, and the room around a figure's panels.
# Nothing has to be measured first, which is what takes the time.
MIN_WIDTH, MIN_COLUMN, PIXEL = 10.0, 4.5, 0.0115
TOP, LEFT, RIGHT, BOTTOM, GAP, LEGEND, LETTER = 0.3, 0.8, 0.25, 0.62, 0.1, 0.25, 0.055
MATRIX_HEIGHT = 240
MAX_TICKS = 5
# A line of more than four times so many samples is drawn by the extremes of so many parts, which keeps its peaks.
MAX_PARTS = 600


def draw(path: Path, title: str, rows: Sequence[Sequence[Figure]]) -> None:
    """Draw figures, each with its only variant, in rows; a row has one legend, unless rows above have named all of it.

    Parameters
    ----------
    path : Path
        Its suffix is of a format that Matplotlib writes, such as ``.png``.
    title : str
        Of the whole picture.

    Raises
    ------
    ScaraIdentError
        If the file cannot be written, or its suffix is of no picture.
    """
    picture = canvas(title, rows)

    def write(place: Path) -> None:
        try:
            picture.savefig(place, dpi=DPI)
        except ValueError as error:
            raise ScaraIdentError(f"{path}: cannot be written: {' '.join(str(error).split())}") from None

    write_whole(path, write)


def drawn(title: str, rows: Sequence[Sequence[Figure]]) -> bytes:
    """Return what `draw` writes into a PNG file."""
    content = BytesIO()
    canvas(title, rows).savefig(content, dpi=DPI, format="png")
    return content.getvalue()


def canvas(title: str, rows: Sequence[Sequence[Figure]], *, min_width: float = MIN_WIDTH) -> Canvas:
    """Return figures in rows as one picture of at least a width, inches, see `draw`."""
    from matplotlib.figure import Figure as Canvas

    rows = [row for row in rows if row]
    width = max(min_width, MIN_COLUMN * max((len(row) for row in rows), default=1))
    named: set[str] = set()
    legends = []
    for row in rows:
        names = _names(row)
        legends.append(() if named.issuperset(names) else names)
        named.update(names)
    heights = [
        max(_height(figure) for figure in row) + LEGEND * bool(names) for row, names in zip(rows, legends, strict=True)
    ]
    picture = Canvas(figsize=(width, sum(heights) + TOP))
    picture.text(0.5, 1.0 - 0.5 * TOP / (sum(heights) + TOP), title, fontsize=11, ha="center", va="center")
    top = sum(heights)
    for row, names, height in zip(rows, legends, heights, strict=True):
        handles: dict[str, Any] = {}
        for k, figure in enumerate(row):
            corner = (k * width / len(row), top - LEGEND * bool(names))
            handles |= _draw_figure(picture, figure, corner, width / len(row))
        if names:
            shown = [name for name in names if name in handles]
            picture.legend(
                [handles[name] for name in shown], shown, loc="center", ncols=len(shown), fontsize=8, frameon=False,
                bbox_to_anchor=(0.5, (top - 0.5 * LEGEND) / (sum(heights) + TOP)),
            )  # fmt: skip
        top -= height

    return picture


def _only(figure: Figure) -> Drawing:
    (drawing,) = figure.variants.values()
    return drawing


def _names(row: Sequence[Figure]) -> tuple[str, ...]:
    """Return what a legend of a row names."""
    plots = [drawing for figure in row if isinstance(drawing := _only(figure), Plot) and not figure.quiet]
    layers = [layer for plot in plots for panel in plot.panels for layer in panel.layers]
    return tuple(dict.fromkeys(filter(None, (getattr(layer, "name", "") for layer in layers))))


def _height(figure: Figure) -> float:
    """Return the inches that a figure needs."""
    drawing = _only(figure)
    if isinstance(drawing, Matrix):
        return TOP + MATRIX_HEIGHT * PIXEL + BOTTOM
    below = LETTER * max((len(name) for name in drawing.names), default=0)
    return TOP + sum(PIXEL * panel.height + GAP for panel in drawing.panels) + BOTTOM + below


def _draw_figure(canvas: Canvas, figure: Figure, corner: tuple[float, float], width: float) -> dict[str, Any]:
    """Draw a figure with its upper left corner at a place, inches, and return what a legend needs by name."""
    (left, y), drawing, size = corner, _only(figure), canvas.get_size_inches()
    canvas.text((left + LEFT) / size[0], (y - 0.6 * TOP) / size[1], figure.title, fontsize=9, va="center")
    y -= TOP

    def axes(height: float, **options: Any) -> Axes:
        place = ((left + LEFT) / size[0], (y - height) / size[1], (width - LEFT - RIGHT) / size[0], height / size[1])
        return canvas.add_axes(place, **options)

    if isinstance(drawing, Matrix):
        _draw_matrix(canvas, axes(MATRIX_HEIGHT * PIXEL), drawing)
        return {}
    found: list[Axes] = []
    handles: dict[str, Any] = {}
    for panel in drawing.panels:
        axis = axes(PIXEL * panel.height, sharex=found[0] if found else None)
        _draw_panel(axis, panel, drawing)
        # Every tick takes its time: the lines of the grid are marks enough.
        axis.tick_params(which="both", labelsize=7, left=False, bottom=False, labelbottom=panel is drawing.panels[-1])
        handles |= dict(zip(*reversed(axis.get_legend_handles_labels()), strict=True))
        found.append(axis)
        y -= PIXEL * panel.height + GAP
    found[-1].set_xlabel(drawing.x_label, fontsize=8)
    return handles


def _draw_panel(axis: Axes, panel: Panel, plot: Plot) -> None:
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
    if plot.equal:
        axis.set_aspect("equal", adjustable="datalim")
    # Limits are found only when asked for; from here on they stay.
    axis.autoscale_view()
    # Where scales are to be equal, one of them must give way.
    axis.autoscale(plot.equal)
    for layer in panel.layers:
        if layer not in fitted:
            _draw_layer(axis, layer)
    if not plot.log and not plot.names:
        axis.locator_params(axis="x", nbins=MAX_TICKS)
    if not panel.log:
        axis.locator_params(axis="y", nbins=MAX_TICKS)
    if not panel.log and not plot.equal:
        axis.axhline(0.0, color="0.5", lw=0.5, zorder=0)
    if plot.names:
        axis.set_xticks(range(len(plot.names)), plot.names, rotation=90)
    axis.set_ylabel(panel.label, fontsize=8)
    axis.grid(color="0.92", lw=0.6)
    axis.set_axisbelow(True)


def _along(x: Any) -> Any:
    return x.values() if isinstance(x, Grid) else np.asarray(x, dtype=float)


def _draw_layer(axis: Axes, layer: Layer) -> None:
    name = getattr(layer, "name", "") or None
    color = COLORS[str(getattr(layer, "color", "black"))]
    match layer:
        case Line():
            size = layer.x.count // MAX_PARTS if isinstance(layer.x, Grid) else 0
            thin = layer.thinned(size if size >= 4 else 1)
            dash: Any = (0, tuple(float(x) for x in thin.dash.split())) if thin.dash else "-"
            axis.plot(_along(thin.x), np.asarray(thin.y), color=color, lw=0.8 * thin.width, ls=dash, label=name)
        case Band():
            axis.fill_between(_along(layer.x), layer.low, layer.high, color=color, alpha=0.22, lw=0.0, label=name)
        case Dots():
            axis.errorbar(layer.x, layer.y, yerr=layer.bar, fmt="o", ms=layer.radius, color=color, label=name)
        case Density():
            counts = np.log1p(layer.counts.T)
            shade = np.zeros((*counts.shape, 4))
            shade[..., :3] = [int(color[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]
            shade[..., 3] = 0.85 * counts / max(float(counts.max()), 1e-12)
            axis.imshow(shade, extent=(*layer.x, *layer.y), origin="lower", aspect="auto", interpolation="nearest")
        case Region():
            axis.axvspan(*layer.x, ymax=layer.share, color=color, alpha=layer.opacity, lw=0.0, label=name)
        case Level():
            axis.axhline(layer.y, color=color, lw=0.8, ls="--", label=name)
        case Mark():
            axis.axvline(layer.x, color=color, lw=0.8, ls="--")


def _draw_matrix(canvas: Canvas, axis: Axes, matrix: Matrix) -> None:
    from matplotlib.colors import LinearSegmentedColormap

    colours = LinearSegmentedColormap.from_list("signs", [COLORS["vermillion"], "white", COLORS["blue"]])
    image = axis.imshow(matrix.values, cmap=colours, vmin=-matrix.most, vmax=matrix.most, aspect="auto")
    for set_ticks, labels in ((axis.set_xticks, matrix.columns), (axis.set_yticks, matrix.rows)):
        every = max(1, len(labels) // 4)
        set_ticks(range(0, len(labels), every), list(labels)[::every], fontsize=7)
    axis.set_xlabel(matrix.column_label, fontsize=8)
    axis.set_ylabel(matrix.row_label, fontsize=8)
    canvas.colorbar(image, ax=axis).ax.tick_params(labelsize=7)
