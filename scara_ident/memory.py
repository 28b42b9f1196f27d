"""The limit of memory that reading a file may take: a small file can unpack to more than the machine has.

And how much the C library keeps of what was freed: the system clears each page that it gives, which for arrays that live
shortly takes as long as to fill them.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import cache
from pathlib import Path

from scara_ident.calling import asked_for
from scara_ident.errors import MemoryLimit, UsageError

GIGA = 1e9
# Of the machine's memory, where no limit is given: what is made of a recording has to have room beside it.
SHARE = 0.5
# Where the system does not say how much it has.
USUAL_MEMORY = 8e9
MIN_SHARE = 0.05
# Memory that JSON takes when it is read, by its bytes: a number of three signs is an object of 24 bytes, and a place in a list.
JSON_FACTOR = 10.0
# Arrays up to the first size are taken from what was freed, of which the second is kept, bytes: the largest size that the C
# library knows, and what the arrays of one recording of minutes take.
ARRAY_BYTES, KEPT_BYTES = 2**25, 2**27
# Of mallopt(3).
_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3

_given: list[float] = []


def set_limit(gigabytes: float | None) -> None:
    """Set the most memory that reading a file may take, GB; None is the machine's.

    Raises
    ------
    UsageError
        If it is less than what reading any file takes.
    """
    if gigabytes is not None and not gigabytes >= MIN_SHARE:
        raise UsageError(f"{asked_for('--max-memory', 'gigabytes')} {gigabytes:g}: expected at least {MIN_SHARE:g} GB")
    _given[:] = [] if gigabytes is None else [gigabytes * GIGA]


def limit() -> float:
    """Return the most memory that reading a file may take, bytes: as set, else half of the machine's."""
    return _given[0] if _given else SHARE * _of_machine()


def check_memory(path: Path, needed: float) -> None:
    """Refuse a file before it is read, by the bytes that it will take.

    Raises
    ------
    MemoryLimit
    """
    if needed > limit():
        raise _too_much(path, f"about {needed / GIGA:.2g} GB of memory, more than {limit() / GIGA:.2g} GB")


def read_text(path: Path) -> str:
    """Return the text of a file of results, which is read as JSON then, within the limit.

    Raises
    ------
    MemoryLimit
        If what is in it takes more.
    OSError, UnicodeDecodeError
    """
    check_memory(path, JSON_FACTOR * path.stat().st_size)
    return path.read_text(encoding="utf-8")


@contextmanager
def within_limit(path: Path) -> Iterator[None]:
    """Hold what is allocated while a file is read to the limit, for formats that do not say what they unpack to.

    By the limit of the process's address space, where the system has one. A library that ends the process where it gets no
    memory is to be asked by `check_memory` instead.

    Raises
    ------
    MemoryLimit
        If it takes more.
    """
    before = _narrow()
    try:
        yield
    except MemoryError:
        raise _too_much(path, f"more than {limit() / GIGA:.2g} GB of memory") from None
    finally:
        if before is not None:
            import resource

            resource.setrlimit(resource.RLIMIT_AS, before)


@cache
def keep_freed() -> None:
    """Keep freed memory for the next arrays, where the C library is glibc and nobody has set otherwise."""
    import ctypes

    if "GLIBC_TUNABLES" in os.environ or any(name.startswith("MALLOC_") for name in os.environ):
        return
    # One that has no such function, as musl's or the one of Windows, is left alone.
    with suppress(OSError, AttributeError, TypeError):
        library = ctypes.CDLL(None)
        _ = library.gnu_get_libc_version
        for option, size in ((_TRIM_THRESHOLD, KEPT_BYTES), (_MMAP_THRESHOLD, ARRAY_BYTES)):
            library.mallopt(option, size)


def _too_much(path: Path, what: str) -> MemoryLimit:
    more = asked_for("--max-memory", "scara_ident.memory.set_limit")
    return MemoryLimit(f"{path}: reading it takes {what}; cut the file, or allow more with {more}")


def _narrow() -> tuple[int, int] | None:
    """Narrow the address space to what is used and the limit; return what it was, None where that cannot be done."""
    try:
        import resource

        used = int(Path("/proc/self/statm").read_text(encoding="ascii").split()[0]) * resource.getpagesize()
        before = resource.getrlimit(resource.RLIMIT_AS)
        wanted = used + int(limit())
        if before[0] != resource.RLIM_INFINITY and before[0] <= wanted:
            return None
        resource.setrlimit(resource.RLIMIT_AS, (wanted, before[1]))
    except (ImportError, OSError, ValueError):
        return None
    return before


@cache
def _of_machine() -> float:
    """Memory of the machine, or of the container that this runs in, bytes."""
    found = []
    with suppress(AttributeError, OSError, ValueError):
        found.append(float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")))
    with suppress(OSError, ValueError):
        found.append(float(Path("/sys/fs/cgroup/memory.max").read_text(encoding="ascii")))
    with suppress(ImportError, OSError):
        import resource

        own = resource.getrlimit(resource.RLIMIT_AS)[0]
        found += [] if own == resource.RLIM_INFINITY else [float(own)]
    return min(found, default=USUAL_MEMORY)
