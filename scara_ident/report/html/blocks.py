"""What a section is made of: words, tables, groups of figures. Templates draw them and escape what they hold."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from scara_ident.arrays import Array
from scara_ident.report.plot import Figure, packed


@dataclass(frozen=True)
class Paragraph:
    """Plain words."""

    kind: ClassVar[str] = "paragraph"
    text: str


@dataclass(frozen=True)
class Heading:
    """A heading within a section."""

    kind: ClassVar[str] = "heading"
    text: str


@dataclass(frozen=True)
class Listing:
    """A list of plain words."""

    kind: ClassVar[str] = "listing"
    items: tuple[str, ...]


@dataclass(frozen=True)
class Tag:
    """A small label; ``mood`` is ``good``, ``bad`` or ``plain``."""

    text: str
    mood: str = "plain"


@dataclass(frozen=True)
class Cell:
    """A cell of a table.

    Attributes
    ----------
    text : str
    kind : str
        ``num``, ``name``, ``unit``, ``words`` or ``why``, as the style sheet has them.
    strength : float or None
        From -1 to 1: the colour of a heat map.
    title, note : str
        Bold before the text, small after it.
    bar : float or None
        A bar before the text: a share of what the style sheet gives to the whole.
    weak : bool
        The bar warns.
    track : float or None
        A bar on the whole that it is a share of, vermillion where it is more.
    tag : Tag or None
    choose : tuple or None
        Group of figures and what a click on the text chooses there.
    """

    text: str = ""
    kind: str = ""
    strength: float | None = None
    title: str = ""
    note: str = ""
    bar: float | None = None
    weak: bool = False
    track: float | None = None
    tag: Tag | None = None
    choose: tuple[str, tuple[int, ...]] | None = None


def name(text: str) -> Cell:
    """Return the cell that names a row."""
    return Cell(text, "name")


@dataclass(frozen=True, eq=False)
class Table:
    """A table; columns in ``numeric`` are set to the right."""

    kind: ClassVar[str] = "table"
    head: Sequence[str]
    rows: Sequence[Sequence[Cell | str]]
    numeric: Sequence[int] = ()


@dataclass(frozen=True)
class Scale:
    """The colours of a table that is a heat map, between words for its two ends."""

    kind: ClassVar[str] = "scale"
    low: str
    high: str
    two_sided: bool = False


@dataclass(frozen=True)
class Selector:
    """A choice among options, shared by the figures of a group."""

    label: str
    options: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class Group:
    """Figures side by side, with the selectors that they share.

    Attributes
    ----------
    name : str
        Unique on the page.
    figures : sequence of Figure
    selectors : sequence of Selector
    columns : str
        "" for one, ``two`` or ``three`` on a wide screen.
    """

    kind: ClassVar[str] = "group"
    name: str
    figures: Sequence[Figure]
    selectors: Sequence[Selector] = ()
    columns: str = ""


@dataclass(frozen=True, eq=False)
class Arm:
    """The moving arm: positions of its joints in a plane or in space, every ``period`` seconds.

    Attributes
    ----------
    name : str
        Unique on the page.
    frames : ndarray, shape (frames, points, 2 or 3)
        m.
    period : float
        s.
    axes : tuple of str
        Names of the axes, two or three.
    """

    kind: ClassVar[str] = "arm"
    name: str
    frames: Array
    period: float
    axes: tuple[str, ...] = ("x", "y")

    @property
    def spatial(self) -> bool:
        """Whether it moves in space."""
        return len(self.axes) == 3

    def spec(self) -> dict[str, Any]:
        """Return what the page draws: coordinates one after the other, points of a frame, frame by frame."""
        low, high = self.frames.min(axis=(0, 1)).tolist(), self.frames.max(axis=(0, 1)).tolist()
        points, frames = self.frames.shape[1], packed(self.frames.ravel())
        return {"points": points, "frames": frames, "period": self.period, "low": low, "high": high, "axes": self.axes}


@dataclass(frozen=True)
class Gain:
    """What a joint's error was and what it became."""

    joint: str
    before: float
    after: float
    unit: str

    def share(self, value: float) -> float:
        """Return a value as a share of the larger of the two."""
        return value / (max(self.before, self.after) or 1.0)


@dataclass(frozen=True)
class Gains:
    """Before and after as a pair of bars for each joint, every joint on its own scale."""

    kind: ClassVar[str] = "gains"
    title: str
    each: tuple[Gain, ...]


@dataclass(frozen=True, eq=False)
class Folded:
    """A block that is shown on demand."""

    kind: ClassVar[str] = "folded"
    title: str
    inside: Block


@dataclass(frozen=True, eq=False)
class Beside:
    """Two blocks side by side on a wide screen."""

    kind: ClassVar[str] = "beside"
    blocks: tuple[Block, Block]


Block = Paragraph | Heading | Listing | Table | Scale | Group | Arm | Gains | Folded | Beside


_ESTIMATORS = {
    "ols": "least squares",
    "wls": "weighted least squares",
    "rls": "recursive least squares",
    "consistent": "weighted least squares with physically consistent parameters",
}


def number(value: float | None, digits: int = 3) -> str:
    """Return a value with so many significant digits, zeros at the end included; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "–"
    return "0" if value == 0.0 else f"{value:#.{digits}g}".rstrip(".")


def chance(probability: float) -> str:
    """Return a probability in few digits."""
    if probability < 1e-99:
        return "< 1e-99"
    return f"{probability:.2g}" if probability >= 1e-3 else f"{probability:.0e}"


def information_words(log_det: float | None, condition: float | None) -> str:
    """Say what the motion tells of the parameters, by the two numbers of Indri et al. (2002)."""
    return (
        f"Information of the motion about all parameters together: J_d = ln det HᵀH = {number(log_det, 4)}; larger is "
        f"better. Condition number J_k = cond HᵀH = {number(condition)}; it is small if no combination of parameters "
        f"is poorly excited."
    )


def estimator_words(method: str) -> str:
    """Return the name of an estimator as a textbook has it; that of an installed package stays as it is."""
    return _ESTIMATORS.get(method, method)


def superscripts(unit: str) -> str:
    """Return a unit or formula with its exponents raised."""
    return unit.replace("^2", "²").replace("^3", "³")
