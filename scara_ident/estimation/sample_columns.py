"""A model's columns at every sample: held in memory, or computed again where they would not fit."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from scara_ident.arrays import Array
from scara_ident.model.model import TorqueModel
from scara_ident.motion.prepared import PreparedData, PreparedRecording

# Columns of every joint at every sample of a stretch, (k, N) each.
Raw = tuple[Array, ...]
# Samples times joints whose columns are held: they take 0.2 kB each of a six-joint arm, and a diagnosis of them 1.2 kB, which is
# 0.6 and 3 GB (benchmarks/many_logs.py).
MAX_VALUES = 2_400_000


@dataclass(frozen=True, eq=False)
class SampleColumns:
    """For every recording, stretch and joint the columns at every sample, not filtered.

    Attributes
    ----------
    model : TorqueModel
    recordings : tuple of PreparedRecording
    held : tuple of (tuple of tuple of ndarray, each of shape (k, N)) or None
        By recording, stretch and joint; None for a recording whose columns are made anew each time.
    """

    model: TorqueModel
    recordings: tuple[PreparedRecording, ...]
    held: tuple[tuple[Raw, ...] | None, ...]

    def __len__(self) -> int:
        return len(self.held)

    def __getitem__(self, place: int) -> tuple[Raw, ...]:
        held = self.held[place]
        if held is None:
            return tuple(self.model.joint_columns(part.motion) for part in self.recordings[place].stretches)
        return held

    def __iter__(self) -> Iterator[tuple[Raw, ...]]:
        return (self[place] for place in range(len(self)))

    def of(self, places: Sequence[int]) -> SampleColumns:
        """Return those of some recordings."""
        return SampleColumns(self.model, tuple(self.recordings[k] for k in places), tuple(self.held[k] for k in places))


def evenly(count: int, number: int) -> list[int]:
    """Return ``number`` of ``count`` places, evenly over all."""
    return [int(place) for place in np.floor((np.arange(number) + 0.5) * count / number)]


def few_enough(data: PreparedData) -> bool:
    """Whether the columns of data at every sample are held."""
    return sum(part.samples for part in data.stretches) * len(data.bands) <= MAX_VALUES
