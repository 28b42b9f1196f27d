"""The search for the reading of the channels that leaves least: of several joints none may be better for itself."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import chain, combinations, product
from math import comb

import numpy as np

from scara_ident.identification.channel_comparison import mean
from scara_ident.identification.channel_reading import QUARTERS, JointReading, Reading, as_mapped, with_joint
from scara_ident.identification.few_rows import FewRows

# Joints whose zeros are tried together, whatever each leaves alone; more only where the first of them leave less. Of arms with
# many joints fewer, so that there are not more readings than this; nor all signs of their efforts.
MAX_JOINTS_TOGETHER, MAX_READINGS = 3, 1000
# What may be of opposite sign on a joint.
SIGNS = (JointReading(-1, 1), JointReading(1, -1), JointReading(-1, -1))
# Readings that the search goes on from.
KEPT_READINGS = 5
# What two readings leave differs by less than this share where they are one and the same.
SAME_ERROR_SHARE = 1e-3
# What a reading is from the mapping: a number under an offset, a factor, or an axis of the URDF, which is two factors.
ZERO_COST, FACTOR_COST, AXIS_COST = 2, 2, 3


def cost(reading: Reading) -> int:
    """Return how much of the mapping a reading changes."""
    total = 0
    for own in reading:
        total += ZERO_COST * (own.quarters != 0)
        total += AXIS_COST if own.axis_turned else FACTOR_COST * ((own.effort < 0) + (own.position < 0))
    return total


def searched(rows: FewRows) -> dict[Reading, float]:
    """Search the readings of all joints: signs, and zeros of a few together, then from the best on by one joint at a time.

    Returns
    -------
    dict of tuple of JointReading to float
        Of all that were tried the geometric mean of what they leave of the joints' torque.
    """
    start = as_mapped(len(rows.q))
    tried: dict[Reading, float] = {}
    changes = _telling(rows, tried)
    front = [start, *_signs(start), *_zeros(start, changes)]
    _try(rows, tried, front)
    front, least = _distinct(tried, front)[:KEPT_READINGS], np.inf
    while tried[front[0]] < least:
        least = tried[front[0]]
        new = [
            with_joint(one, j, own)
            for one in front
            for j, every in enumerate(changes)
            for own in (*every, JointReading())
        ]
        _try(rows, tried, new)
        front = _distinct(tried, list(dict.fromkeys([*front, *new])))[:KEPT_READINGS]
    return tried


def _signs(start: Reading) -> Iterator[Reading]:
    """Give all signs of efforts, which share their columns, and other signs of two joints."""
    for effort in product((1, -1), repeat=len(start) if 2 ** len(start) <= MAX_READINGS else 0):
        yield tuple(JointReading(sign) for sign in effort) or start
    for pair in combinations(range(len(start)), 2):
        for one, other in product(SIGNS, repeat=2):
            yield with_joint(with_joint(start, pair[0], one), pair[1], other)


def _zeros(start: Reading, changes: Sequence[Sequence[JointReading]]) -> Iterator[Reading]:
    """Give the zeros of a few joints together."""
    every = [(j, own) for j, some in enumerate(changes) for own in some if own.signal is None]
    together = [count for count in range(1, MAX_JOINTS_TOGETHER + 1) if comb(len(every), count) <= MAX_READINGS]
    for some in chain.from_iterable(combinations(every, count) for count in together):
        if len({j for j, _ in some}) == len(some):
            reading = start
            for j, own in some:
                reading = with_joint(reading, j, own)
            yield reading


def _telling(rows: FewRows, tried: dict[Reading, float]) -> list[list[JointReading]]:
    """Return of each joint the readings that leave not the same as the mapping or as a simpler one does."""
    start = as_mapped(len(rows.q))
    found = []
    for j, prismatic in enumerate(rows.model.robot.prismatic):
        quarters = (0,) if prismatic else (0, *QUARTERS)
        own = [with_joint(start, j, JointReading(e, p, k)) for k in quarters for p in (1, -1) for e in (1, -1)]
        _try(rows, tried, own)
        found.append([reading[j] for reading in _distinct(tried, own) if reading != start])
    return found


def _try(rows: FewRows, tried: dict[Reading, float], readings: Sequence[Reading]) -> None:
    new = [reading for reading in dict.fromkeys(readings) if reading not in tried]
    rows.leave(new)
    tried |= {reading: mean(rows.left(reading)) for reading in new}


def _distinct(tried: dict[Reading, float], readings: Sequence[Reading]) -> list[Reading]:
    """Return readings in the order of what they leave, of those that leave the same the simplest alone."""
    found: list[Reading] = []
    edge = 0.0
    for reading in sorted(readings, key=tried.__getitem__):
        if tried[reading] > edge:
            found.append(reading)
            edge = tried[reading] * (1.0 + SAME_ERROR_SHARE)
        elif cost(reading) < cost(found[-1]):
            found[-1] = reading
    return found
