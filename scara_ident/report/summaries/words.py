"""Numbers, tables and sentences as text."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from io import StringIO
from math import floor, log10
from typing import TYPE_CHECKING

from rich.console import Console
from rich.table import Table

if TYPE_CHECKING:
    from rich.console import RenderableType

# Characters of a line of a summary.
WIDTH = 100


def table(title: str, *columns: str, right: tuple[str, ...] = ()) -> Table:
    """Return an empty table; the columns in ``right`` are aligned to the right."""
    result = Table(title=title, title_justify="left", box=None, pad_edge=False, header_style="bold")
    for column in columns:
        result.add_column(column, justify="right" if column in right else "left", overflow="fold")
    return result


def in_units(units: Mapping[str, str]) -> str:
    """Return the unit of most joints, and the others', of units by joint."""
    usual = Counter(units.values()).most_common(1)[0][0]
    return "; ".join([usual, *(f"{joint} {unit}" for joint, unit in units.items() if unit != usual)])


def number(value: float, std: float | None = None) -> str:
    """Write a number with four digits, or with as many as its standard deviation allows."""
    if std is not None and 0.0 < std < float("inf"):
        places = max(0, 1 - floor(log10(std)))
        if places <= 9 and abs(value) < 1e7:
            return f"{value:.{places}f}"
    return f"{value:.4g}"


def text_of(*parts: RenderableType) -> str:
    """Return sentences and tables as lines of plain text."""
    out = StringIO()
    console = Console(file=out, width=WIDTH, force_terminal=False, no_color=True, highlight=False, markup=False)
    for part in parts:
        console.print(part)
    return "\n".join(line.rstrip() for line in out.getvalue().splitlines()) + "\n"
