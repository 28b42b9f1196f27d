"""Positions on straight lines between fewer samples: somebody interpolated them, as onto the clock of another signal."""

from __future__ import annotations

import numpy as np

from scara_ident.arrays import Array
from scara_ident.recording.audit.samples import Checked, Finding, Samples, levels

# A position is on a line where it is off it by no more than so many times what it is rounded to, at three places, and at a corner where
# it is off by more than so many times as much.
ROUNDED, CORNER = 2.0, 4.0
# Of the rows in which a joint moves, those on a line are at least this share, and those at a corner this.
ON_LINE, AT_CORNERS = 0.5, 0.01
# Corners of lines between samples come at an even pace: at least this share of them a row or less off it.
EVEN = 0.8


def interpolated_positions(samples: Samples) -> Checked:
    """Say where positions were interpolated: their accelerations are none, but for the corners."""
    active = np.flatnonzero(~samples.idle())
    rows = [rows_between_corners(samples.position[joint]) for joint in active]
    if not len(active) or not all(rows):
        return samples, []
    rate = 1.0 / (float(np.median(rows)) * samples.interval)
    said = (
        f"positions lie on straight lines between points {1.0 / rate:.3g} s apart: they were interpolated, so that "
        f"accelerations are those of the corners; give the samples as they were logged, at about {rate:.3g} Hz, with their own times"
    )
    return samples, [Finding("interpolated_position", said, len(active))]


def rows_between_corners(position: Array) -> float:
    """Return how many rows the corners of a position (N,) are apart; 0 if it does not consist of lines."""
    step, bend = np.abs(np.diff(position)), np.abs(np.diff(position, n=2))
    # The smallest step of a row is larger where a joint moves on; that between any two values is what they are rounded to.
    values = levels(position)
    least = ROUNDED * float(np.min(np.diff(values))) if len(values) > 1 else np.inf
    moving = np.minimum(step[1:], step[:-1]) > least
    count = np.count_nonzero(moving)
    if not count or np.count_nonzero(moving & (bend <= least)) < ON_LINE * count:
        return 0.0
    corners = np.flatnonzero(moving & (bend > CORNER * least))
    # A point between two rows bends the position at both.
    corners = corners[np.diff(corners, prepend=-2) > 1]
    if len(corners) < max(AT_CORNERS * count, 4):
        return 0.0
    apart = np.diff(corners)
    usual = float(np.median(apart))
    return usual if np.mean(np.abs(apart - usual) <= 1.0) >= EVEN else 0.0
