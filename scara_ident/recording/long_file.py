"""Files that are too long to hold at once: how they are cut, which parts are read together, and what of them is kept.

Whatever the length of a recording, it is prepared in pieces, and each piece by itself: so long files need no overlap, and rows
read part by part are those of the whole. The pieces are found in a first pass over the clock alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from scara_ident.memory import check_memory
from scara_ident.recording.audit.samples import GAP_STEPS
from scara_ident.recording.files.parquet_csv import PER_VALUE
from scara_ident.recording.files.parquet_rows import read_rows, row_groups, seekable

# Longer parts of a recording are cut: no work of it needs more memory than this many samples take.
MAX_SAMPLES = 60_000
# A file of more samples is read in parts. As many at once take 0.6 GB of a two-joint arm and 1.7 GB of a seven-joint one
# (benchmarks/streaming.py), what a small machine has.
LONGEST_WHOLE = 500_000
# Samples that are read at once, and samples that are kept for what has to see samples side by side, in so many windows.
PART_SAMPLES = 4 * MAX_SAMPLES
KEPT_SAMPLES = 4 * MAX_SAMPLES
WINDOWS = 8
# Samples of the clock that are looked at together.
CLOCK_ROWS = 1_000_000


@dataclass(frozen=True, eq=False)
class LongFile:
    """A file that is read in parts.

    Attributes
    ----------
    bounds : tuple of int
        Rows at which its pieces begin, from 0 on, and the number of its rows.
    """

    path: Path
    bounds: tuple[int, ...]

    @property
    def samples(self) -> int:
        """Number of its rows."""
        return self.bounds[-1]

    @property
    def parts(self) -> tuple[tuple[int, ...], ...]:
        """Bounds of pieces that are read together, part by part: all of the file."""
        return _together(self.bounds, PART_SAMPLES)

    @property
    def windows(self) -> tuple[tuple[int, ...], ...]:
        """Bounds of pieces that are kept, window by window: spread evenly over the file, and all of one that is not longer.

        Short pieces are kept together with their neighbours: alone they say little, or nothing.
        """
        if self.samples <= KEPT_SAMPLES:
            return (self.bounds,)
        most = KEPT_SAMPLES // WINDOWS
        groups = _together(self.bounds, most)
        size = sum(min(group[-1] - group[0], most) for group in groups)
        count = min(len(groups), max(WINDOWS, KEPT_SAMPLES * len(groups) // size))
        starts = [group[0] for group in groups]
        places = np.unique(np.searchsorted(starts, np.linspace(0, starts[-1], count).astype(int), side="right") - 1)
        return tuple(_first_of(groups[k], KEPT_SAMPLES // count) for k in places)


def long_file(path: Path, time: str, names: Sequence[str]) -> LongFile | None:
    """Find the pieces of a file that is to be read in parts; None where it is short, or cannot be read so.

    Parameters
    ----------
    time : str
        Column of the clock.
    names : sequence of str
        All columns that are wanted.

    Raises
    ------
    RecordingError
        If the file is damaged.
    MemoryLimit
        If one of its groups of rows takes more memory than may be taken.
    """
    if path.suffix.lower() != ".parquet" or path.is_dir():
        return None
    groups = row_groups(path)
    samples = sum(groups)
    if samples <= LONGEST_WHOLE or not seekable(path, time, names):
        return None
    check_memory(path, PER_VALUE * len(names) * max(groups))
    return LongFile(path, tuple(cut_long([0, *_gaps(path, time, samples), samples])))


def _together(bounds: Sequence[int], most: int) -> tuple[tuple[int, ...], ...]:
    """Return bounds of neighbouring pieces that have together no more than ``most`` rows, or of one that alone has more."""
    found = [[bounds[0]]]
    for stop in bounds[1:]:
        if stop - found[-1][0] > most and len(found[-1]) > 1:
            found.append([found[-1][-1]])
        found[-1].append(stop)
    return tuple(tuple(part) for part in found)


def _first_of(bounds: Sequence[int], most: int) -> tuple[int, ...]:
    """Return the bounds of the first ``most`` rows of pieces."""
    stop = min(bounds[-1], bounds[0] + most)
    return (*(bound for bound in bounds if bound < stop), stop)


def _gaps(path: Path, time: str, samples: int) -> list[int]:
    """Return the rows before which time leaps."""
    found: list[NDArray[np.intp]] = []
    usual = None
    for start in range(0, samples, CLOCK_ROWS):
        first = max(0, start - 1)
        step = np.diff(read_rows(path, [time], first, min(start + CLOCK_ROWS, samples))[time])
        # Rows that repeat a time are left out later, and are no steps.
        onward = step[np.isfinite(step) & (step > 0.0)] if usual is None else step
        usual = float(np.median(onward)) if usual is None and len(onward) else usual
        if usual is not None:
            found.append(np.flatnonzero(step > GAP_STEPS * usual) + first + 1)
    return [int(row) for row in np.concatenate(found)] if found else []


def cut_long(bounds: Sequence[int]) -> list[int]:
    """Divide parts that are too long into equal ones."""
    found = [bounds[0]]
    for start, stop in pairwise(bounds):
        pieces = -(-(stop - start) // MAX_SAMPLES)
        found += [start + (stop - start) * k // pieces for k in range(1, pieces + 1)]
    return found
