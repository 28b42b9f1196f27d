"""Assumed variation between runs, where there are too few to estimate it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.arrays import Array
from scara_ident.estimation.joint_rows import JointRows
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.run_variation import KINDS, JointVariation, RunVariation, directions_of

# Of fewer runs than tell, each is taken to have friction, an offset and a delay of its own with these standard deviations, shares of the
# friction and of the joint's rms torque, and s: what a gear does as it warms, a sensor between days, and few samples of a
# slow recorder. A torque scale of its own would hide one that differs between joints.
ASSUMED_FRICTION, ASSUMED_OFFSET, ASSUMED_DELAY = 0.05, 0.02, 0.003
# Share of all torque, asked of what acts in some recordings only: days differ by it, and of it a load is made.
ASSUMED_SCALE = 0.02


def assumed_variation(
    observations: Observations, joints: Sequence[JointRows], value: Array, scale: float = 0.0
) -> RunVariation:
    """Return how runs would differ had each friction, an offset and a delay of its own, where they are too few to say so.

    Parameters
    ----------
    observations, joints, value
        See `run_variation`.
    scale : float, optional
        Share of all torque by which they would differ too.
    """
    runs = len(observations.data.recordings)
    firsts = np.searchsorted(observations.owner, np.arange(runs + 1))
    found: list[JointVariation | None] = []
    for joint, rows in enumerate(joints):
        if rows.table.shape[1] == 0:
            # At rest throughout.
            found.append(None)
            continue
        noise = float(np.sqrt(np.mean(rows.left(value) ** 2)))
        directions = directions_of(observations, joint, rows, value)
        offset = ASSUMED_OFFSET * float(np.sqrt(np.mean(directions[KINDS.index("torque scale")] ** 2)))
        std = np.array([ASSUMED_FRICTION, scale, offset, ASSUMED_DELAY])
        shown = noise > 0.0 and bool(np.any(directions[std > 0.0]))
        nothing = np.zeros((runs, len(KINDS)))
        item = JointVariation(directions, std, nothing, noise, rows.starts[firsts], nothing, assumed=True)
        found.append(item if shown else None)
    return RunVariation(tuple(found))
