"""The page: sections of words, tables and groups of figures, assembled into one file that needs no network."""

from __future__ import annotations

import html
import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from scara_ident.files import write_whole
from scara_ident.report.html.plot import Figure, Matrix

# A space at which no line ends.
_TIED = "\u00a0"


def escape(text: object) -> str:
    """Return text that HTML shows as it is."""
    return html.escape(str(text))


@dataclass(frozen=True)
class Text:
    """A piece of HTML whose parts are escaped by whoever wrote it."""

    html: str


def paragraph(text: str, kind: str = "") -> Text:
    """Return a paragraph of plain words."""
    return Text(f"<p{_class(kind)}>{escape(text)}</p>")


def heading(text: str) -> Text:
    """Return a heading within a section."""
    return Text(f"<h3>{escape(text)}</h3>")


def listing(items: Iterable[str]) -> Text:
    """Return a list of plain words."""
    return Text("<ul>" + "".join(f"<li>{escape(item)}</li>" for item in items) + "</ul>")


def folded(title: str, inside: Text) -> Text:
    """Return something shown on demand."""
    return Text(f"<details><summary>{escape(title)}</summary>{inside.html}</details>")


@dataclass(frozen=True)
class Cell:
    """A cell of a table: its HTML and its kind (``num``, ``name``, ``heat`` with a strength from -1 to 1)."""

    html: str
    kind: str = ""
    strength: float | None = None

    def render(self) -> str:
        """Return the cell."""
        if self.strength is None:
            return f"<td{_class(self.kind)}>{self.html}</td>"
        kind = "heat low" if self.strength < 0.0 else "heat"
        return f'<td class="{kind}" style="--s:{min(1.0, abs(self.strength)):.3f}">{self.html}</td>'


def table(head: Sequence[str], rows: Iterable[Sequence[Cell | str]], numeric: Sequence[int] = ()) -> Text:
    """Return a table; strings are escaped, columns in ``numeric`` are set to the right."""

    def cell(k: int, value: Cell | str) -> str:
        return (
            value.render() if isinstance(value, Cell) else Cell(escape(value), "num" if k in numeric else "").render()
        )

    top = "".join(
        # Long names of joints may break after an underscore.
        f'<th{_class("num" if k in numeric else "")} scope="col">{escape(word).replace("_", "_<wbr>")}</th>'
        for k, word in enumerate(head)
    )
    body = "".join("<tr>" + "".join(cell(k, value) for k, value in enumerate(row)) + "</tr>" for row in rows)
    return Text(f'<div class="wide"><table><thead><tr>{top}</tr></thead><tbody>{body}</tbody></table></div>')


def number(value: float | None, digits: int = 3) -> str:
    """Return a value with so many significant digits, zeros at the end included; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "–"
    return f"{value:#.{digits}g}".rstrip(".")


def chance(probability: float) -> str:
    """Return a probability in few digits."""
    if probability < 1e-99:
        return "< 1e-99"
    return f"{probability:.2g}" if probability >= 1e-3 else f"{probability:.0e}"


def count(size: int, noun: str) -> str:
    """Return how many of something there are, such as ``1 recording``."""
    return f"{size} {noun}" if size == 1 else f"{size} {noun}s"


def colour_scale(low: str, high: str, *, two_sided: bool = False) -> Text:
    """Return the scale of colours of a table that is a heat map, between words for its two ends."""
    middle = "var(--bg) 50%, " if two_sided else ""
    start = "color-mix(in srgb, var(--c-below) 70%, transparent)" if two_sided else "var(--bg)"
    stop = "color-mix(in srgb, var(--c-above) 70%, transparent)"
    return Text(
        f'<div class="scale">{escape(low)}<i style="background:linear-gradient(to right, {start}, {middle}{stop})"></i>'
        f"{escape(high)}</div>"
    )


def superscripts(unit: str) -> str:
    """Return a unit or formula with its exponents raised."""
    return unit.replace("^2", "²").replace("^3", "³")


def tag(text: str, kind: str = "plain") -> str:
    """Return a small label as HTML; ``kind`` is ``good``, ``bad`` or ``plain``."""
    return f'<span class="tag {kind}">{escape(text)}</span>'


def bar(share: float, *, weak: bool = False) -> str:
    """Return a bar whose length is a share of what the style sheet gives to the whole as HTML."""
    length = f"calc(var(--whole) * {min(1.0, max(0.0, share)):.3f})"
    return f'<span class="bar{" weak" if weak else ""}" style="width:{length}"></span>'


def track(share: float) -> str:
    """Return a bar on the whole that it is a share of as HTML; vermillion where it is more than the whole."""
    return f'<span class="track">{bar(share, weak=share > 1.005)}</span>'


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

    name: str
    figures: Sequence[Figure]
    selectors: Sequence[Selector] = ()
    columns: str = ""


@dataclass(frozen=True, eq=False)
class Arm:
    """The moving arm: positions of its joints in a plane, shape (frames, points, 2), every ``period`` seconds.

    Attributes
    ----------
    name : str
        Unique on the page.
    frames : ndarray
        m.
    period : float
        s.
    axes : tuple of str
        Names of the plane's axes.
    """

    name: str
    frames: Any
    period: float
    axes: tuple[str, str] = ("x", "y")


@dataclass(frozen=True, eq=False)
class Beside:
    """Two blocks side by side on a wide screen."""

    blocks: tuple[Block, Block]


Block = Text | Group | Arm | Beside


@dataclass(frozen=True, eq=False)
class Section:
    """A part of the page with its place in the table of contents."""

    name: str
    title: str
    blocks: Sequence[Block]


@dataclass(frozen=True, eq=False)
class Page:
    """A page.

    Attributes
    ----------
    title, subtitle : str
    verdict : sequence of str
        The first is the verdict in a sentence.
    sections : sequence of Section
    warn : bool
        Whether the verdict is bad news.
    """

    title: str
    subtitle: str
    verdict: Sequence[str]
    sections: Sequence[Section]
    warn: bool = False

    def render(self) -> str:
        """Return the whole file's text."""
        figures = {figure.name: figure.spec() for group in self._blocks(Group) for figure in group.figures}
        arms = {arm.name: _arm_spec(arm) for arm in self._blocks(Arm)}
        # A script element ends at the first "</script", whatever surrounds it.
        data = json.dumps({"figures": figures, "arms": arms}, separators=(",", ":"), allow_nan=False).replace(
            "<", "\\u003c"
        )
        links = "".join(f'<a href="#{section.name}">{escape(section.title)}</a>' for section in self.sections)
        verdict = "".join(f"<p>{escape(sentence).replace(' N m', f' N{_TIED}m')}</p>" for sentence in self.verdict)
        return (
            '<!DOCTYPE html>\n<html lang="en" data-theme="auto">\n<head>\n<meta charset="utf-8">\n'
            '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
            f'<title>{escape(self.title)}</title>\n<link rel="icon" href="data:,">\n'
            f"<style>\n{_asset('report.css')}</style>\n</head>\n<body>\n"
            f'<header><h1>{escape(self.title)}</h1><p class="sub">{escape(self.subtitle)}</p>'
            f'<div class="verdict{" warn" if self.warn else ""}" id="verdict">{verdict}</div></header>\n'
            f'<nav aria-label="contents"><div>{links}<button type="button" id="theme">theme: auto</button></div></nav>\n<main>\n'
            + "\n".join(_section(section) for section in self.sections)
            + "\n</main>\n<footer>Drag along x to zoom, double-click to see all; shift-drag or two fingers to move; with a figure in focus "
            "also + − ← → 0. A click on a legend hides a line. SI units throughout."
            "<noscript> The figures need JavaScript; tables and words do not.</noscript></footer>\n"
            f'<script type="application/json" id="report-data">{data}</script>\n'
            f"<script>\n{_asset('plot.js')}</script>\n<script>\n{_asset('report.js')}</script>\n</body>\n</html>\n"
        )

    def write(self, path: Path) -> None:
        """Write the page, whole or not at all."""
        text = self.render()
        write_whole(path, lambda temporary: _write(temporary, text))

    def _blocks(self, kind: type[Any]) -> list[Any]:
        return [block for section in self.sections for block in _flat(section.blocks) if isinstance(block, kind)]


def _flat(blocks: Sequence[Block]) -> list[Block]:
    return [inner for block in blocks for inner in (_flat(block.blocks) if isinstance(block, Beside) else (block,))]


def _write(path: Path, text: str) -> None:
    path.write_text(text, encoding="utf-8")


def _asset(name: str) -> str:
    return (files("scara_ident.report.html") / "assets" / name).read_text(encoding="utf-8")


def _class(kind: str) -> str:
    return f' class="{kind}"' if kind else ""


def _section(section: Section) -> str:
    return (
        f'<section id="{section.name}"><h2>{escape(section.title)}</h2>'
        + "\n".join(_block(block) for block in section.blocks)
        + "</section>"
    )


def _block(block: Block) -> str:
    if isinstance(block, Text):
        return block.html
    if isinstance(block, Beside):
        return f'<div class="beside">{"".join(f"<div>{_block(inner)}</div>" for inner in block.blocks)}</div>'
    if isinstance(block, Arm):
        return (
            f'<figure class="moving" data-arm="{block.name}"><figcaption><b>The arm in its plane</b>'
            "<p>Square: the base. Grey: where the arm's end goes; orange: its last second.</p></figcaption>"
            '<div class="plot"></div><div class="controls"><button type="button">▶ move</button>'
            '<input type="range" min="0" max="1" value="0" aria-label="time"><output>0 s</output></div></figure>'
        )
    return _group(block)


def _group(group: Group) -> str:
    controls = ""
    for place, selector in enumerate(group.selectors):
        identity = f"{group.name}-{place}"
        options = "".join(f"<option>{escape(option)}</option>" for option in selector.options)
        controls += (
            f'<label for="{identity}">{escape(selector.label)}</label>'
            f'<select id="{identity}" data-place="{place}" autocomplete="off">{options}</select>'
        )
    controls = f'<div class="controls">{controls}</div>' if controls else ""
    figures = "".join(_figure(figure) for figure in group.figures)
    return f'<div data-group="{group.name}">{controls}<div class="figures{" " + group.columns if group.columns else ""}">{figures}</div></div>'


_TOOLS = "".join(
    f'<button type="button" data-act="{act}" title="{words}" aria-label="{words}">{sign}</button>'
    for act, sign, words in (
        ("in", "+", "zoom in"),
        ("out", "−", "zoom out"),
        ("back", "←", "move back"),
        ("on", "→", "move on"),
        ("all", "⟲", "show all"),
    )
)


def _figure(figure: Figure) -> str:
    matrix = all(isinstance(drawing, Matrix) for drawing in figure.variants.values())
    tools = "" if matrix else f'<span class="tools">{_TOOLS}</span>'
    words = f"<p>{escape(figure.words)}</p>" if figure.words else ""
    kind = "matrix" if matrix else ("quiet" if figure.quiet else "")
    focus = "" if matrix else ' tabindex="0"'
    return (
        f'<figure{_class(kind)} data-figure="{escape(figure.name)}"><figcaption><b>{escape(figure.title)}</b>{tools}{words}</figcaption>'
        f'<div class="legend"></div><div class="plot"{focus}></div></figure>'
    )


def _arm_spec(arm: Arm) -> dict[str, Any]:
    low, high = arm.frames.min(axis=(0, 1)), arm.frames.max(axis=(0, 1))
    frames = [[[round(float(x), 4) for x in point] for point in frame] for frame in arm.frames]
    return {"frames": frames, "period": arm.period, "low": low.tolist(), "high": high.tolist(), "axes": arm.axes}
