"""Reading recordings while what works on them is loaded."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from scara_ident.recording.apart import Usable
    from scara_ident.robot.robot import Robot

# What the audit of a recording needs too: loaded before, it is loaded once for both processes.
BEFORE = ("scipy.special",)
# What all work on recordings loads sooner or later.
LATER = ("scipy.fft", "scipy.linalg")


@contextmanager
def read_beside(arm: Robot, *each: Sequence[Path | str]) -> Iterator[Callable[[], list[Usable]]]:
    """Read recordings in another process while what works on them is loaded; yields what waits for them, see `usable_beside`."""
    from scara_ident.recording.apart import usable_beside

    for name in BEFORE:
        import_module(name)
    with usable_beside(arm, *each) as wanted:
        for name in LATER:
            import_module(name)
        yield wanted
