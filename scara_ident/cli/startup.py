"""Faster start and end of a command; no result depends on it."""

from __future__ import annotations

import atexit
import gc
import os

# New containers after which Python looks for some that refer to each other alone. At its usual 700 all that has been loaded is
# gone through while the rest is loaded.
CONTAINERS = 10_000


def begin_soon() -> None:
    """Load SciPy where it is used, and look for garbage less often, and not in what goes with the process."""
    gc.set_threshold(CONTAINERS)
    atexit.register(gc.freeze)
    # Its BLAS need not be loaded at once then to be held to one thread, see `one_blas_thread`.
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
