"""Terminals: tables that fit 80 columns, progress only where a person watches."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

RecordingArguments = Annotated[
    list[str], typer.Argument(metavar="RECORDING...", help="Recordings (.parquet, .csv), folders or globs of them.")
]
RobotOption = Annotated[
    Path | None, typer.Option("--robot", metavar="FILE", help="robot.yaml (or a URDF); default: the embedded SCARA03.")
]
OutputOption = Annotated[
    Path | None, typer.Option("--output", metavar="DIR", help="Folder for the results; made if needed.")
]


class PlainConsole(Console):
    """A console that prints names as they are, brackets included, and stops quietly when nobody reads any more."""

    def __init__(self, *, stderr: bool = False, width: int | None = None) -> None:
        super().__init__(stderr=stderr, width=width, highlight=False, markup=False)

    def on_broken_pipe(self) -> None:
        """Leave it to the program what a reader that has gone means; rich would exit with status 1."""
        raise BrokenPipeError


def output_console() -> Console:
    """Return a console on stdout; 100 columns where it is not a terminal."""
    console = PlainConsole()
    return console if console.is_terminal else PlainConsole(width=100)


def errors_console() -> Console:
    """Return a console on stderr."""
    return PlainConsole(stderr=True)


@contextmanager
def progress() -> Iterator[Callable[[str], None]]:
    """Show the step that runs on a terminal, and nothing in a pipe."""
    console = errors_console()
    if not console.is_terminal:
        yield lambda step: None
        return
    with console.status("starting") as status:
        yield lambda step: status.update(step)


def table(title: str, *columns: str, right: tuple[str, ...] = ()) -> Table:
    """Return an empty table; the columns in ``right`` are aligned to the right."""
    result = Table(title=title, title_justify="left", box=None, pad_edge=False, header_style="bold")
    for column in columns:
        result.add_column(column, justify="right" if column in right else "left", overflow="fold")
    return result


def number(value: float, std: float | None = None) -> str:
    """Write a number with four digits, or with as many as its standard deviation allows."""
    if std is not None and 0.0 < std < float("inf"):
        from math import floor, log10

        places = max(0, 1 - floor(log10(std)))
        if places <= 9 and abs(value) < 1e7:
            return f"{value:.{places}f}"
    return f"{value:.4g}"
