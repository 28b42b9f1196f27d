"""Columns without names: time, then as many positions, velocities and efforts as there are joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import product

import numpy as np

from scara_ident.arrays import Array
from scara_ident.inspection.names import Meaning
from scara_ident.inspection.values import ALIKE, slopes, time_unit

# What slopes confirm comes first.
BLOCKS = {3: ("position", "velocity", "effort"), 2: ("position", "effort")}


def meanings_by_place(numbers: Mapping[str, Array], counts: Sequence[int]) -> dict[str, Meaning]:
    """Return what columns without names hold, where their number and their slopes say it; nothing where they do not.

    Parameters
    ----------
    numbers : mapping of str to ndarray, shape (N,)
        All columns, in the file's order.
    counts : sequence of int
        How many joints there may be, the likeliest first.
    """
    names = list(numbers)
    if not names or time_unit(numbers[names[0]]) is None:
        return {}
    for shares, count in product(BLOCKS, counts):
        if len(names) - 1 != shares * count:
            continue
        blocks = dict(zip(BLOCKS[shares], np.reshape(names[1:], (shares, count)).tolist(), strict=True))
        if "velocity" in blocks and not _are_slopes(numbers, names[0], blocks["position"], blocks["velocity"]):
            continue
        return {names[0]: _meaning("time", None)} | {
            name: _meaning(quantity, k + 1) for quantity, block in blocks.items() for k, name in enumerate(block)
        }
    return {}


def _meaning(quantity: str, number: int | None) -> Meaning:
    return Meaning(quantity, None, number, None, False, False, f"{quantity} {{number}}", frozenset())


def _are_slopes(numbers: Mapping[str, Array], time: str, positions: Sequence[str], velocities: Sequence[str]) -> bool:
    slope, middle = slopes(numbers[time], np.array([numbers[name] for name in positions]))
    for known, name in zip(slope, velocities, strict=True):
        recorded = numbers[name][middle]
        if np.std(known) > 0 and (np.std(recorded) == 0 or np.corrcoef(known, recorded)[0, 1] < ALIKE):
            return False
    return True
