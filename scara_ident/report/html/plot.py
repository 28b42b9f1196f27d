"""What a figure is made of: layers on panels over one x axis, and how arrays are packed for the page."""

from __future__ import annotations

import base64
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

# Arrays longer than this become 16-bit integers, which resolve 1/65000 of their range.
MOST_PLAIN = 400
_NO_VALUE = -32768
_LARGEST = 32767


def packed(values: ArrayLike) -> Any:
    """Return an array as what the page reads: a short list of numbers, or 16-bit integers in base64.

    Parameters
    ----------
    values : array_like, shape (N,)
        Numbers that are not finite become gaps.
    """
    array = np.asarray(values, dtype=float)
    if array.size <= MOST_PLAIN:
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


Along = Grid | ArrayLike


def _along(x: Along) -> Any:
    return {"from": x.start, "step": x.step, "count": x.count} if isinstance(x, Grid) else packed(x)


class Layer(Protocol):
    """Something drawn on a panel."""

    def spec(self) -> dict[str, Any]:
        """Return what the page draws."""
        ...


@dataclass(frozen=True, eq=False)
class Line:
    """A line; of any length, no peak is lost. x grows unless ``path``, which draws any curve."""

    x: Along
    y: ArrayLike
    color: str
    name: str = ""
    width: float = 1.3
    dash: str = ""
    path: bool = False
    fit: bool = True

    def spec(self) -> dict[str, Any]:
        """Return what the page draws."""
        spec: dict[str, Any] = {"t": "line", "x": _along(self.x), "y": packed(self.y), "c": self.color, "w": self.width}
        if self.dash:
            spec["d"] = self.dash
        if self.path:
            spec["path"] = True
        if not self.fit:
            spec["fit"] = False
        return _named(spec, self.name)


@dataclass(frozen=True, eq=False)
class Band:
    """The area between two lines."""

    x: Along
    low: ArrayLike
    high: ArrayLike
    color: str
    name: str = ""
    fit: bool = True

    def spec(self) -> dict[str, Any]:
        """Return what the page draws."""
        spec = {"t": "band", "x": _along(self.x), "lo": packed(self.low), "hi": packed(self.high), "c": self.color}
        if not self.fit:
            spec["fit"] = False
        return _named(spec, self.name)


@dataclass(frozen=True, eq=False)
class Dots:
    """Points, with bars of half length ``bar`` where it is given."""

    x: ArrayLike
    y: ArrayLike
    color: str
    name: str = ""
    bar: ArrayLike | None = None
    radius: float = 2.4

    def spec(self) -> dict[str, Any]:
        """Return what the page draws."""
        spec = {"t": "dots", "x": packed(self.x), "y": packed(self.y), "c": self.color, "r": self.radius}
        if self.bar is not None:
            spec["e"] = packed(self.bar)
        return _named(spec, self.name)


@dataclass(frozen=True, eq=False)
class Density:
    """How many samples lie where, shape (nx, ny), between ``x`` and ``y`` limits; drawn on a logarithmic scale."""

    counts: Array
    x: tuple[float, float]
    y: tuple[float, float]
    color: str
    name: str = ""

    def spec(self) -> dict[str, Any]:
        """Return what the page draws."""
        strength = np.log1p(self.counts) / max(float(np.log1p(np.max(self.counts, initial=1.0))), 1e-12)
        image = np.rint(255.0 * strength).astype(np.uint8)
        return _named(
            {
                "t": "density",
                "x0": self.x[0],
                "x1": self.x[1],
                "y0": self.y[0],
                "y1": self.y[1],
                "nx": image.shape[0],
                "ny": image.shape[1],
                "z": base64.b64encode(image.tobytes()).decode("ascii"),
                "c": self.color,
            },
            self.name,
        )


@dataclass(frozen=True)
class Region:
    """A range of x, over the lower ``share`` of the panel's height."""

    x: tuple[float, float]
    color: str
    name: str = ""
    opacity: float = 0.1
    share: float = 1.0

    def spec(self) -> dict[str, Any]:
        """Return what the page draws."""
        spec = {"t": "region", "x0": self.x[0], "x1": self.x[1], "c": self.color, "o": self.opacity}
        if self.share < 1.0:
            spec["share"] = self.share
        return _named(spec, self.name)


@dataclass(frozen=True)
class Level:
    """A dashed line at one value of y."""

    y: float
    color: str
    name: str = ""
    fit: bool = True

    def spec(self) -> dict[str, Any]:
        """Return what the page draws."""
        return _named({"t": "h", "y": self.y, "c": self.color, "fit": self.fit}, self.name)


@dataclass(frozen=True)
class Mark:
    """A dashed line at one value of x with words beside it."""

    x: float
    color: str
    label: str = ""

    def spec(self) -> dict[str, Any]:
        """Return what the page draws."""
        return {"t": "v", "x": self.x, "c": self.color, "label": self.label}


def _named(spec: dict[str, Any], name: str) -> dict[str, Any]:
    return {**spec, "name": name} if name else spec


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
        spec: dict[str, Any] = {
            "label": self.label,
            "height": self.height,
            "layers": [layer.spec() for layer in self.layers],
        }
        if self.limits is not None:
            spec["range"] = list(self.limits)
        if self.log:
            spec["log"] = True
        return spec


@dataclass(frozen=True, eq=False)
class Plot:
    """Panels over one x axis. ``equal`` gives both axes the same scale."""

    x_label: str
    panels: Sequence[Panel]
    limits: tuple[float, float] | None = None
    log: bool = False
    small: bool = False
    equal: bool = False

    def spec(self) -> dict[str, Any]:
        """Return what the page draws."""
        x: dict[str, Any] = {"label": self.x_label}
        if self.limits is not None:
            x["range"] = list(self.limits)
        if self.log:
            x["log"] = True
        spec: dict[str, Any] = {"x": x, "panels": [panel.spec() for panel in self.panels]}
        return {**spec, **{key: True for key in ("small", "equal") if getattr(self, key)}}


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
        values = [[None if not np.isfinite(x) else rounded(float(x)) for x in row] for row in self.values]
        return {
            "kind": "matrix",
            "rows": list(self.rows),
            "columns": list(self.columns),
            "z": values,
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

    def spec(self) -> dict[str, Any]:
        """Return what the page draws."""
        variants = {}
        for key, drawing in self.variants.items():
            variants[",".join(map(str, key))] = {**drawing.spec(), "label": self.title}
        return {"by": list(self.by), "variants": variants}


def single(name: str, title: str, words: str, drawing: Drawing, *, quiet: bool = False) -> Figure:
    """Return a figure without variants."""
    return Figure(name, title, words, {(): drawing}, quiet=quiet)
