"""Who called, the command or Python: what a message asks for is an option there and an argument here."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

# Runs of the command that are under way; threads of them see it too.
_commands: list[None] = []


@contextmanager
def by_command() -> Iterator[None]:
    """Let messages name options while a command runs."""
    _commands.append(None)
    try:
        yield
    finally:
        _commands.pop()


def asked_for(option: str, argument: str | None = None) -> str:
    """Return what the caller is to give, or gave: as the command takes it, or as Python does.

    Parameters
    ----------
    option : str
        Such as ``--robot`` or ``--method consistent``.
    argument : str, optional
        By default of the option's name and with its value.
    """
    if _commands:
        return option
    name, _, value = option.removeprefix("--").partition(" ")
    return argument or (f"{name}={value!r}" if value else name)
