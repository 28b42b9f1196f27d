"""Error-stream output of native libraries is kept from the user, who gets one line instead."""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager


class _Stream:
    """The error stream of the process: how many keep it quiet, and where it led before the first of them."""

    def __init__(self) -> None:
        self.lock = threading.Lock()
        self.count = 0
        self.saved: int | None = None

    def close(self) -> None:
        with self.lock:
            self.count += 1
            if self.count > 1:
                return
            try:
                self.saved = os.dup(2)
            except OSError:
                # There is none.
                self.saved = None
                return
            with open(os.devnull, "wb") as sink:
                os.dup2(sink.fileno(), 2)

    def open(self) -> None:
        with self.lock:
            self.count -= 1
            if self.count == 0 and self.saved is not None:
                os.dup2(self.saved, 2)
                os.close(self.saved)
                self.saved = None


_ERRORS = _Stream()


@contextmanager
def quiet_stderr() -> Iterator[None]:
    """Keep what readers in C and Rust write to the error stream from the user; threads may do so side by side."""
    _ERRORS.close()
    try:
        yield
    finally:
        _ERRORS.open()
