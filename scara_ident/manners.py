"""How results behave in a user's hands: short to print, safe to copy and to pickle, and immutable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from html import escape
from importlib import import_module
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Protocol, cast

import numpy as np

from scara_ident.errors import UsageError
from scara_ident.files import write_json

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Characters of a line of a terminal or notebook that names a thing, and rows of a table in a notebook.
LONGEST_LINE = 180
MAX_ROWS = 60


class Frozen:
    """A frozen dataclass that prints as one short line, is pickled and copied by its fields, and has read-only arrays.

    What it has worked out and kept is not part of a copy, which works it out again.
    """

    def __post_init__(self) -> None:
        self.__setstate__(vars(self))

    def __getstate__(self) -> dict[str, Any]:
        held = {field.name: getattr(self, field.name) for field in fields(cast(Any, self))}
        return {name: dict(value) if isinstance(value, MappingProxyType) else value for name, value in held.items()}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        vars(self).update({name: _protected(value) for name, value in state.items()})

    def __repr__(self) -> str:
        line = f"{type(self).__name__}({self._in_short()})"
        return line if len(line) <= LONGEST_LINE else f"{line[: LONGEST_LINE - 4]}...)"

    def _in_short(self) -> str:
        """Say what it is, in part of a line; by default its fields that are given, arrays by shape."""
        given = ((field.name, getattr(self, field.name)) for field in fields(cast(Any, self)) if field.repr)
        return ", ".join(f"{name}={_in_short(value)}" for name, value in given if value is not None)


class Reports(Protocol):
    """A module that tells of one kind of result."""

    def summary(self, result: Any) -> str:
        """Return the result in words and tables, as a terminal has it."""
        ...

    def content(self, result: Any) -> dict[str, Any]:
        """Return the content of the result's file."""
        ...

    def columns(self, result: Any) -> dict[str, Any]:
        """Return the table of the result, column by column."""
        ...

    def figure(self, result: Any) -> Figure:
        """Draw the result."""
        ...


class Reported(Frozen):
    """A result that tells of itself: in words, as a table, as a figure, and in a notebook."""

    # The module of the room `report` that tells of it. That room knows the results, so it is loaded when it is asked.
    _reported_by: ClassVar[str]

    def __init_subclass__(cls, reported_by: str | None = None) -> None:
        if reported_by is not None:
            cls._reported_by = reported_by

    @property
    def _reports(self) -> Reports:
        return cast(Reports, import_module(f"scara_ident.report.summaries.{self._reported_by}"))

    def summary(self) -> str:
        """Return the result in words and tables, as the command prints it."""
        return self._reports.summary(self)

    def to_frame(self, library: Literal["polars", "pandas"] = "polars") -> Any:
        """Return the result's table as a data frame.

        Parameters
        ----------
        library : {"polars", "pandas"}

        Returns
        -------
        polars.DataFrame or pandas.DataFrame

        Raises
        ------
        UsageError
            If the library is another one, or is not installed.
        """
        if library not in ("polars", "pandas"):
            raise UsageError(f"to_frame: {library!r} makes no frames here; expected 'polars' or 'pandas'")
        try:
            frames = import_module(library)
        except ImportError:
            raise UsageError(f"to_frame: {library} is not installed: pip install {library}") from None
        return frames.DataFrame(self._reports.columns(self))

    def plot(self) -> Figure:
        """Draw the result.

        Returns
        -------
        matplotlib.figure.Figure
            Of its own: no state of pyplot is touched. A notebook shows it, ``savefig`` writes it.
        """
        return self._reports.figure(self)

    def _repr_html_(self) -> str:
        """Return the line that names the result and its table, for a notebook."""
        table = self._reports.columns(self)
        count = len(next(iter(table.values()), ()))
        head = "".join(f"<th>{escape(name)}</th>" for name in table)
        rows = [
            "".join(f"<td>{escape(_cell(values[k]))}</td>" for values in table.values())
            for k in range(min(count, MAX_ROWS))
        ]
        more = f"<p>{count - MAX_ROWS} more rows</p>" if count > MAX_ROWS else ""
        body = "".join(f"<tr>{row}</tr>" for row in rows)
        return f"<p>{escape(repr(self))}</p><table><tr>{head}</tr>{body}</table>{more}"


class Saved(Reported):
    """A result that is written to a file."""

    def save(self, path: Path | str) -> None:
        """Write the result as JSON, whole or not at all, as the command does.

        Parameters
        ----------
        path : path
            An existing file is replaced.

        Raises
        ------
        ScaraIdentError
            In one line, if it cannot be written.
        """
        write_json(Path(path), self._reports.content(self))


def several(count: int, noun: str) -> str:
    """Return a number and what it counts, such as ``1 row`` or ``3 rows``."""
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def listed(names: Sequence[str], most: int, sep: str = ", ") -> str:
    """Return the first of some names, and how many more there are."""
    return sep.join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def _protected(value: Any) -> Any:
    """Return arrays as views that cannot be written, also those in tuples and mappings."""
    if isinstance(value, np.ndarray):
        if not value.flags.writeable:
            return value
        view = value.view()
        view.flags.writeable = False
        return view
    if type(value) is tuple:
        held = tuple(_protected(item) for item in value)
        return held if any(new is not old for new, old in zip(held, value, strict=True)) else value
    if type(value) is dict:
        return MappingProxyType({key: _protected(item) for key, item in value.items()})
    return value


def _in_short(value: Any) -> str:
    """Return a field of a thing in a few characters."""
    if isinstance(value, np.ndarray):
        return f"array of {' x '.join(map(str, value.shape))}"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, Path):
        return repr(value.name)
    if isinstance(value, bool | int | str):
        text = repr(value)
        return text if len(text) <= 40 else f"{text[:36]}..."
    if isinstance(value, tuple | list | Mapping):
        return f"{len(value)} {'entries' if isinstance(value, Mapping) else 'items'}"
    return type(value).__name__


def _cell(value: Any) -> str:
    if isinstance(value, float | np.floating):
        return f"{value:.4g}"
    return "" if value is None else str(value)
