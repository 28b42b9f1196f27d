"""What a figure is made of: layers on panels over one x axis; the page and the pictures draw the same."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from scara_ident.arrays import Array
from scara_ident.report.bins import Means

# Arrays longer than this become 16-bit integers, which resolve 1/65000 of their range.
MAX_PLAIN_LENGTH = 400
_NO_VALUE = -32768
_LARGEST = 32767
# Colours and dashes that tell many lines apart.
COLORS = ("blue", "vermillion", "green", "orange", "purple", "black")
DASHES = ("", "7 3", "2 3")
# What the script calls them; other fields go by their own names.
_SHORT = {"color": "c", "width": "w", "dash": "d", "opacity": "o", "radius": "r", "bar": "e", "low": "lo", "high": "hi"}
_ARRAYS = ("x", "y", "low", "high", "bar")


def style(k: int) -> tuple[str, str]:
    """Return the colour and the dash of the k-th of many lines."""
    return COLORS[k % len(COLORS)], DASHES[k // len(COLORS) % len(DASHES)]


def packed(values: ArrayLike) -> Any:
    """Return an array as what the page reads: a short list of numbers, or 16-bit integers in base64.

    Parameters
    ----------
    values : array_like, shape (N,)
        Numbers that are not finite become gaps.
    """
    array = np.asarray(values, dtype=float)
    if array.size <= MAX_PLAIN_LENGTH:
        return [rounded(x) for x in array.tolist()]
    finite = np.isfinite(array)
    low, high = (float(np.min(array[finite])), float(np.max(array[finite]))) if finite.any() else (0.0, 0.0)
    offset, scale = 0.5 * (low + high), (high - low) / (2 * _LARGEST) or 1.0
    whole = np.full(array.shape, _NO_VALUE, dtype="<i2")
    whole[finite] = np.rint((array[finite] - offset) / scale)
    return {"q": base64.b64encode(whole.tobytes()).decode("ascii"), "scale": scale, "offset": offset}


def rounded(value: float) -> float | None:
    """Return a number with six digits; None where it is not finite."""
    return float(f"{value:.6g}") if np.isfinite(value) else None


@dataclass(frozen=True)
class Grid:
    """Equal steps along x."""

    start: float
    step: float
    count: int

    def values(self) -> Array:
        """Return every x, shape (count,)."""
        return self.start + self.step * np.arange(float(self.count))


Along = Grid | ArrayLike


@dataclass(frozen=True, eq=False)
class Layer:
    """Something drawn on a panel."""

    kind: ClassVar[str]

    def spec(self) -> dict[str, Any]:
        """Return what the page draws; a field with its default is left out."""
        spec: dict[str, Any] = {"t": self.kind}
        for each in fields(self):
            value = getattr(self, each.name)
            if each.default is value:
                continue
            if isinstance(value, Grid):
                value = {"from": value.start, "step": value.step, "count": value.count}
            elif each.name in _ARRAYS and np.ndim(value):
                value = packed(value)
            spec[_SHORT.get(each.name, each.name)] = value
        return spec


@dataclass(frozen=True, eq=False)
class Line(Layer):
    """A line; of any length, no peak is lost. x grows unless ``path``, which draws any curve."""

    kind = "line"
    x: Along
    y: ArrayLike
    color: str
    name: str = ""
    width: float = 1.3
    dash: str = ""
    path: bool = False
    fit: bool = True

    def thinned(self, bucket: int) -> Line:
        """Return the line with the lowest and the highest of every ``bucket`` samples of its grid only."""
        if bucket < 2 or not isinstance(self.x, Grid):
            return self
        values, step = envelope(np.asarray(self.y, dtype=float), bucket), 0.5 * bucket * self.x.step
        # Two values stand for a bucket, at its quarter and at its three quarters.
        return replace(self, x=Grid(self.x.start + 0.5 * (step - self.x.step), step, len(values)), y=values)


def mean_layers(means: Means, color: str, name: str) -> tuple[Layer, Layer]:
    """Return means as a line in a band of two standard errors."""
    band = Band(means.x, means.y - 2.0 * means.error, means.y + 2.0 * means.error, color)
    return band, Line(means.x, means.y, color, name, 1.8)


def thin_line(
    time: Array, signal: Array, most: int, color: str, label: str, width: float = 1.4, dash: str = ""
) -> Line:
    """Return a line over equally spaced times of about so many points at the most."""
    every = max(1, len(time) // most)
    step = float(time[-1] - time[0]) / (len(time) - 1)
    return Line(Grid(float(time[0]), every * step, -(-len(time) // every)), signal[::every], color, label, width, dash)


def envelope(signal: Array, bucket: int) -> Array:
    """Return the lowest and highest of every ``bucket`` samples, in the order in which they came.

    Parameters
    ----------
    signal : ndarray, shape (N,)
    bucket : int

    Returns
    -------
    ndarray, shape (2 ceil(N / bucket),)
    """
    missing = (-len(signal)) % bucket
    rows = np.pad(signal, (0, missing), mode="edge").reshape(-1, bucket)
    low, high = rows.min(axis=1), rows.max(axis=1)
    rises = rows.argmin(axis=1) <= rows.argmax(axis=1)
    return np.column_stack([np.where(rises, low, high), np.where(rises, high, low)]).ravel()


@dataclass(frozen=True, eq=False)
class Band(Layer):
    """The area between two lines."""

    kind = "band"
    x: Along
    low: ArrayLike
    high: ArrayLike
    color: str
    name: str = ""
    fit: bool = True


@dataclass(frozen=True, eq=False)
class Dots(Layer):
    """Points, with bars of half length ``bar`` where it is given."""

    kind = "dots"
    x: ArrayLike
    y: ArrayLike
    color: str
    name: str = ""
    bar: ArrayLike | None = None
    radius: float = 2.4


@dataclass(frozen=True, eq=False)
class Density(Layer):
    """How many samples lie where, shape (nx, ny), between ``x`` and ``y`` limits; drawn on a logarithmic scale."""

    kind = "density"
    counts: Array
    x: tuple[float, float]
    y: tuple[float, float]
    color: str
    name: str = ""

    def spec(self) -> dict[str, Any]:
        """Return what the page draws."""
        strength = np.log1p(self.counts) / max(float(np.log1p(np.max(self.counts, initial=1.0))), 1e-12)
        image = np.rint(255.0 * strength).astype(np.uint8)
        (x0, x1), (y0, y1), (nx, ny) = self.x, self.y, image.shape
        spec = {"t": self.kind, "x0": x0, "x1": x1, "y0": y0, "y1": y1, "nx": nx, "ny": ny, "c": self.color}
        return {**spec, "z": base64.b64encode(image.tobytes()).decode("ascii"), "name": self.name}


@dataclass(frozen=True, eq=False)
class Region(Layer):
    """A range of x, over the lower ``share`` of the panel's height."""

    kind = "region"
    x: tuple[float, float]
    color: str
    name: str = ""
    opacity: float = 0.1
    share: float = 1.0

    def spec(self) -> dict[str, Any]:
        """Return what the page draws."""
        spec = super().spec()
        del spec["x"]
        return {**spec, "x0": self.x[0], "x1": self.x[1]}


@dataclass(frozen=True, eq=False)
class Level(Layer):
    """A dashed line at one value of y."""

    kind = "h"
    y: float
    color: str
    name: str = ""
    fit: bool = True


@dataclass(frozen=True, eq=False)
class Mark(Layer):
    """A dashed line at one value of x with words beside it."""

    kind = "v"
    x: float
    color: str
    label: str = ""


@dataclass(frozen=True, eq=False)
class Panel:
    """Layers over one y axis."""

    label: str
    layers: Sequence[Layer]
    height: int = 200
    limits: tuple[float, float] | None = None
    log: bool = False

    def spec(self) -> dict[str, Any]:
        """Return what the page draws."""
        layers = [layer.spec() for layer in self.layers]
        spec: dict[str, Any] = {"label": self.label, "height": self.height, "layers": layers}
        return spec | _axis(self.limits, self.log)


@dataclass(frozen=True, eq=False)
class Plot:
    """Panels over one x axis.

    Attributes
    ----------
    x_label : str
    panels : sequence of Panel
    limits : tuple of float, optional
    log, small : bool
    equal : bool
        Both axes have the same scale.
    names : sequence of str
        What stands at x = 0, 1, .... instead of numbers.
    """

    x_label: str
    panels: Sequence[Panel]
    limits: tuple[float, float] | None = None
    log: bool = False
    small: bool = False
    equal: bool = False
    names: Sequence[str] = ()

    def spec(self) -> dict[str, Any]:
        """Return what the page draws."""
        x = {"label": self.x_label} | _axis(self.limits, self.log) | ({"names": list(self.names)} if self.names else {})
        spec: dict[str, Any] = {"x": x, "panels": [panel.spec() for panel in self.panels]}
        return {**spec, **{key: True for key in ("small", "equal") if getattr(self, key)}}


def _axis(limits: tuple[float, float] | None, log: bool) -> dict[str, Any]:
    return ({} if limits is None else {"range": list(limits)}) | ({"log": True} if log else {})


@dataclass(frozen=True, eq=False)
class Matrix:
    """A heat map of named rows and columns; colour is full at ``most``, cells that are not finite stay empty."""

    rows: Sequence[str]
    columns: Sequence[str]
    values: Array
    most: float = 1.0
    row_label: str = ""
    column_label: str = ""

    def spec(self) -> dict[str, Any]:
        """Return what the page draws."""
        return {
            "kind": "matrix",
            "rows": list(self.rows),
            "columns": list(self.columns),
            "z": [[rounded(float(x)) for x in row] for row in self.values],
            "most": self.most,
            "rowLabel": self.row_label,
            "columnLabel": self.column_label,
        }


Drawing = Plot | Matrix


@dataclass(frozen=True, eq=False)
class Figure:
    """A figure with a title and words, of which the selectors of its group choose one variant.

    Attributes
    ----------
    name : str
        Unique on the page.
    title, words : str
    variants : mapping of tuple of int to Drawing
        By the choices of the selectors in ``by``; a variant that is absent hides the figure.
    by : tuple of int
        Selectors that it depends on.
    quiet : bool
        Without a legend, where the words around it say what its colours are.
    """

    name: str
    title: str
    words: str
    variants: Mapping[tuple[int, ...], Drawing] = field(default_factory=dict)
    by: tuple[int, ...] = ()
    quiet: bool = False

    @property
    def matrix(self) -> bool:
        """Whether it is a heat map, which cannot be zoomed."""
        return all(isinstance(drawing, Matrix) for drawing in self.variants.values())

    def spec(self) -> dict[str, Any]:
        """Return what the page draws."""
        variants = {
            ",".join(map(str, key)): {**drawing.spec(), "label": self.title or _said(drawing)}
            for key, drawing in self.variants.items()
        }
        return {"by": list(self.by), "variants": variants}


def _said(drawing: Drawing) -> str:
    """What a figure without a title shows, for those who hear it."""
    return ", ".join(panel.label for panel in drawing.panels) if isinstance(drawing, Plot) else "table of colours"


def single(name: str, title: str, words: str, drawing: Drawing, *, quiet: bool = False) -> Figure:
    """Return a figure without variants."""
    return Figure(name, title, words, {(): drawing}, quiet=quiet)
