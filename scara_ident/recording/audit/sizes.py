"""Numbers that are no measurement, in whatever unit they are."""

from __future__ import annotations

import numpy as np

from scara_ident.manners import several
from scara_ident.recording.audit.position import SPIKE_ROWS, SPIKE_SHARE
from scara_ident.recording.audit.samples import Finding, Samples

# The counts of 32 bits end at 4e9; what a broken channel or a wrong type of number gives has up to 300 digits.
LARGEST = 1e12


def impossible_sizes(samples: Samples) -> tuple[Samples, list[Finding]]:
    """Leave out single positions and efforts that no encoder, no drive and no unit gives; refuse many."""
    found = []
    keep = np.ones(samples.count, dtype=bool)
    for signal, rows in (("position", samples.position), ("effort", samples.effort)):
        if rows is None or not (wild := np.abs(rows) > LARGEST).any():
            continue
        joint = int(np.argmax(wild.sum(axis=1)))
        index, count = int(np.argmax(wild[joint])), int(wild[joint].sum())
        what = f"{samples.robot.joints[joint]}.{signal} is {rows[joint, index]:.3g} in {samples.where(index)}, which no channel gives"
        if count > max(SPIKE_ROWS, SPIKE_SHARE * samples.count):
            samples.refuse(
                f"{what}, so in {count} of {samples.count} rows; check the type of its numbers and record it again"
            )
        keep &= ~wild.any(axis=0)
        found.append(Finding("spike", f"{what}: {several(int(wild.any(axis=0).sum()), 'row')} left out", count))
    return samples.kept(keep), found
