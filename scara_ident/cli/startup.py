"""What lets a command begin and end sooner; nothing of it changes a result."""

from __future__ import annotations

import atexit
import gc
import os
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from scara_ident.recording.recording import Recording
    from scara_ident.robot.robot import Robot

Words: TypeAlias = Sequence[Path | str]
# What `read_usable` returns.
Usable: TypeAlias = "tuple[tuple[Recording, ...], list[str]]"
# New containers after which Python looks for some that refer to each other alone. At its usual 700 all that has been loaded is
# gone through while the rest is loaded.
CONTAINERS = 10_000
# What all work on recordings loads sooner or later.
LATER = ("scipy.fft", "scipy.linalg", "scipy.special")
# Bytes of files that another process reads: what it read of more takes longer to be sent, and memory twice.
SMALL = 30e6


def begin_soon() -> None:
    """Load SciPy where it is used, and look for garbage less often, and not in what goes with the process."""
    gc.set_threshold(CONTAINERS)
    atexit.register(gc.freeze)
    # Its BLAS need not be loaded at once then to be held to one thread, see `one_blas_thread`.
    os.environ["OPENBLAS_NUM_THREADS"] = "1"


@contextmanager
def read_beside(arm: Robot, *each: Words) -> Iterator[Callable[[], list[Usable]]]:
    """Read recordings in another process while what works on them is loaded; yields what waits for them.

    Many or long ones are read here, when they are waited for.

    Parameters
    ----------
    *each : sequence of path or str
        Of each that names any, at least one has to be usable, see `read_usable`.
    """
    from scara_ident.processes import beside
    from scara_ident.recording.paths import recording_paths
    from scara_ident.recording.recording import read_usable

    def read() -> list[Usable]:
        return [read_usable(words, arm) for words in each]

    paths = (path for words in each for path in recording_paths(words))
    # Polars in a process that is forked from one that used it waits for threads that are not there.
    if "polars" in sys.modules or sum(path.stat().st_size for path in paths if path.is_file()) > SMALL:
        yield read
        return
    with beside(read) as told:
        for name in LATER:
            import_module(name)
        yield told
