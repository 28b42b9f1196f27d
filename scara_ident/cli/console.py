"""Terminals: tables that fit 80 columns, progress only where a person watches."""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO
from warnings import catch_warnings, simplefilter

import typer
from rich.console import Console

from scara_ident.errors import PluginWarning
from scara_ident.report.summaries.words import table as table

if TYPE_CHECKING:
    from scara_ident.progress import Work
    from scara_ident.recording.recording import Recording
    from scara_ident.report.html.section import Kind

# Share of the work of a command that reading its recordings takes.
READING_SHARE = 0.05
# Of a pipe or a file, which have no width of their own.
PIPE_WIDTH = 80


class PlainConsole(Console):
    """A console that prints names as they are, brackets included, and falls silent when nobody reads any more."""

    def __init__(self, *, stderr: bool = False, width: int | None = None, quiet: bool = False) -> None:
        super().__init__(stderr=stderr, width=width, quiet=quiet, highlight=False, markup=False)

    def on_broken_pipe(self) -> None:
        """Go on without the reader: results are still to be written to files; rich would exit with status 1."""
        self.quiet = True
        _drain(sys.stderr if self.stderr else sys.stdout)

    def say(self, sentences: Iterable[str]) -> None:
        """Print sentences, each in lines of its own."""
        for sentence in sentences:
            self.print(sentence)

    def note(self, notes: Iterable[str]) -> None:
        """Print what there is to know of the data or the result."""
        for note in notes:
            self.print(f"note: {note}", style="dim")

    def written(self, folder: Path, *names: str) -> None:
        """Tell where files were written, in one line that can be copied."""
        self.print(f"written: {', '.join(str(folder / name) for name in names)}", soft_wrap=True)


def output_console(*, quiet: bool = False) -> PlainConsole:
    """Return a console on stdout, silent if wanted; 80 columns where it is not a terminal."""
    console = PlainConsole(quiet=quiet)
    return console if console.is_terminal else PlainConsole(width=PIPE_WIDTH, quiet=quiet)


def errors_console() -> PlainConsole:
    """Return a console on stderr."""
    return PlainConsole(stderr=True)


@contextmanager
def plugin_notices() -> Iterator[None]:
    """Say in one line on stderr what of an installed package is left out."""
    with catch_warnings():
        # The filter "once" forgets when a library that is loaded later sets filters of its own.
        simplefilter("always", PluginWarning)
        others, said = warnings.showwarning, set()

        def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
            if issubclass(category, PluginWarning):
                if str(message) not in said:
                    said.add(str(message))
                    errors_console().print(f"scara-ident: note: {message}", soft_wrap=True)
            else:
                others(message, category, *where, **more)

        warnings.showwarning = show
        yield


@contextmanager
def progress() -> Iterator[Work]:
    """Show on a terminal which step runs, how much is done and how long the rest takes; nothing in a pipe."""
    from scara_ident.progress import Work

    console = errors_console()
    if not console.is_terminal:
        yield Work()
        return
    from scara_ident.cli.progress_bar import shown

    with shown(console) as tell:
        yield Work(tell)


@contextmanager
def writing(folder: Path) -> Iterator[tuple[Path, Work]]:
    """Write results whole or not at all, see `written_together`; yields their place, and whoever is notified of each."""
    from scara_ident.files import written_together

    with progress() as work, written_together(folder) as place:
        work("writing")
        yield place, work


def check_report(output: Path | None, kind: Kind) -> None:
    """Refuse, before the work, a folder that cannot be written into and a report that cannot be made."""
    from scara_ident.files import check_output

    check_output(output)
    if output is not None:
        from scara_ident.report.html.section import added_sections

        added_sections(kind)


def result_console(content: dict[str, Any], json: bool) -> PlainConsole:
    """Print a result as JSON where that is wanted; return the console for words, which is silent then."""
    if json:
        print_json(content)
    return output_console(quiet=json)


def print_json(content: dict[str, Any]) -> None:
    """Print a result as JSON for scripts; files are still written when nobody reads it."""
    from scara_ident.files import json_text

    try:
        typer.echo(json_text(content))
        sys.stdout.flush()
    except BrokenPipeError:
        _drain(sys.stdout)


def _drain(stream: TextIO) -> None:
    """Send what is still written to a stream whose reader has gone to nowhere."""
    with open(os.devnull, "wb") as sink:
        os.dup2(sink.fileno(), stream.fileno())


def show_recordings(console: Console, recordings: Sequence[Recording]) -> None:
    """Print what every recording holds and what its audit found."""
    from scara_ident.report.summaries.recording import recordings_table

    console.print(recordings_table(recordings))
    for item in recordings:
        for finding in item.findings:
            console.print(f"{item.name}: {finding.message}")
