"""The program: its commands, its errors and its exit status."""

from __future__ import annotations

import errno
import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache
from io import TextIOWrapper
from threading import current_thread, main_thread
from typing import Annotated, Any, NoReturn

import typer

from scara_ident.calling import by_command
from scara_ident.cli import options
from scara_ident.cli.ask import ask
from scara_ident.cli.base import base
from scara_ident.cli.check import check
from scara_ident.cli.compare import compare
from scara_ident.cli.console import errors_console, plugin_notices
from scara_ident.cli.contact import contact
from scara_ident.cli.demo import demo
from scara_ident.cli.diagnose import diagnose
from scara_ident.cli.excite import excite
from scara_ident.cli.export import export
from scara_ident.cli.fleet import fleet
from scara_ident.cli.identify import identify
from scara_ident.cli.inspect import inspect
from scara_ident.cli.paper import paper
from scara_ident.cli.simulate import simulate
from scara_ident.cli.use import use
from scara_ident.errors import ScaraIdentError
from scara_ident.registry import package_of

# Exit status after Ctrl-C, as shells have it; typer gives it back for a command that was interrupted.
INTERRUPTED = 130
TERMINATED = 143

app = typer.Typer(
    name="scara-ident",
    help="Identify the dynamic model of a robot arm from measured motion, and find what the model lacks.",
    no_args_is_help=True,
    add_completion=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


def _version(wanted: bool) -> None:
    if wanted:
        from scara_ident import __version__

        typer.echo(f"scara-ident {__version__}")
        raise typer.Exit


@app.callback()
def program(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version and stop.")
    ] = False,
) -> None:
    """Identify the dynamic model of a robot arm from measured motion, and find what the model lacks."""


# Each with its line in the list of commands, short enough for 80 columns.
_COMMANDS: tuple[tuple[Callable[..., Any], str], ...] = (
    (identify, "Estimate the parameters, predict torques of held-out recordings."),
    (diagnose, "Find what the model lacks, trace it to an effect, add the effect."),
    (compare, "Fit each trajectory, and predict every trajectory with the result."),
    (excite, "Design an excitation trajectory within the arm's limits."),
    (export, "Write the identified arm for other programs."),
    (check, "Say whether the arm can run a motion, and the energy it takes."),
    (contact, "Find contacts with the arm in recordings, and their forces."),
    (ask, "Say what to record next, and design that motion."),
    (simulate, "Record the virtual arm in closed loop."),
    (use, "Say what the model gains as feed-forward and in simulation."),
    (fleet, "Identify many arms on many dates, say which changed and how."),
    (inspect, "Show what is in a file, audit it, write a first robot.yaml."),
    (base, "Print the base parameters: what each is made of."),
    (paper, "Compare the tables of Indri et al. with the computed ones."),
    (demo, "Run the whole story on the embedded arm."),
)
for _command, _line in _COMMANDS:
    app.command(short_help=_line, cls=options.Command)(options.limited(_command))


def main(arguments: list[str] | None = None) -> None:
    """Run the program; each error is one line on stderr and an exit status."""
    for stream in (sys.stdout, sys.stderr):
        # A name that the terminal's encoding cannot show is no reason to fail.
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    sys.exit(run(sys.argv[1:] if arguments is None else arguments))


@cache
def _commands() -> Callable[..., Any]:
    """Return the commands with their options; reading them from all functions takes longer than some commands."""
    return typer.main.get_command(app)


def run(arguments: list[str]) -> int:
    """Run the program and return its exit status: 0 done, 1 the data or model cannot give it, 2 bad usage."""
    try:
        with by_command(), plugin_notices(), _ended_tidily():
            result = _commands()(args=arguments, prog_name="scara-ident", standalone_mode=False)
        status = int(result) if isinstance(result, int) else 0
        if status == INTERRUPTED:
            _complain("interrupted; no file is left half-written")
        return status
    except ScaraIdentError as error:
        _complain(" ".join(str(error).split()))
        return error.exit_status
    except typer.TyperException as error:
        text = error.format_message()
        # Without any word the message is the help, which keeps its lines.
        _complain(_with_help(error, text)) if arguments else errors_console().print(text)
        return 2
    except typer.Exit as error:
        return error.exit_code
    except SystemExit as error:
        if error.code != TERMINATED:
            raise
        _complain("ended by a signal; no file is left half-written")
        return TERMINATED
    except (typer.Abort, KeyboardInterrupt):
        _complain("interrupted; no file is left half-written")
        return INTERRUPTED
    except BrokenPipeError:
        # The reader of our output has gone, as `| head` does.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except MemoryError:
        _complain("out of memory; give fewer recordings at a time, or shorter ones")
        return 1
    except OSError as error:
        # Errors of writing results name their file. Without a name it is what is printed, or a library's temporary file.
        full = error.errno in (errno.ENOSPC, errno.EDQUOT)
        where = error.filename or ("standard output or a temporary file" if full else None)
        _complain(f"{'' if where is None else f'{where}: '}{error.strerror or error}{'; make room' if full else ''}")
        return 1
    except Exception as error:
        # A fault of the program or of an added package: one line for the user, the whole trace for a report.
        if os.environ.get("SCARA_IDENT_TRACEBACK"):
            raise
        what = f"{type(error).__name__}: {' '.join(str(error).split())}"
        package = package_of(error)
        if package is None:
            _complain(f"internal error, {what}; please report it with what SCARA_IDENT_TRACEBACK=1 prints")
        else:
            _complain(
                f"{package} failed with {what}; correct the package or remove it (SCARA_IDENT_TRACEBACK=1 prints more)"
            )
        return 1


@contextmanager
def _ended_tidily() -> Iterator[None]:
    """Clean up unfinished files on SIGTERM, as on Ctrl-C; a handler that is already set is kept."""
    if signal.getsignal(signal.SIGTERM) is not signal.SIG_DFL or current_thread() is not main_thread():
        yield
        return

    def end(*_: object) -> NoReturn:
        # Once only, so that a second signal does not stop the clean-up.
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise SystemExit(TERMINATED)

    signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _with_help(error: typer.TyperException, text: str) -> str:
    """Return a message of the parser as one line that ends with where to read more."""
    context = getattr(error, "ctx", None)
    words = ["scara-ident", *([context.info_name] if context is not None and context.parent else []), "--help"]
    said = " ".join(text.replace("Value error, ", "").split()).rstrip(".")
    return f"{said}{' ' if said.endswith('?') else '; '}see {' '.join(words)}"


def _complain(message: str) -> None:
    errors_console().print(f"scara-ident: {message}", highlight=False, soft_wrap=True)
