"""Whether the arm stayed the same within its recordings: changes that differ between recordings repeat in none, and are no noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from scara_ident.diagnosis.criteria import CRITERIA, SelectionCriteria
from scara_ident.diagnosis.evidence.evidence import Evidence
from scara_ident.estimation import Estimate
from scara_ident.estimation.observations import Observations
from scara_ident.estimation.run_variation import KINDS, JointVariation
from scara_ident.estimation.variation_between import variation_between
from scara_ident.robot.robot import Robot

# Parts of each recording that are compared: a change over a minute shows in few of them, one over seconds in many.
PARTS = (4, 16)
# A part of fewer blocks says next to nothing.
MIN_BLOCKS = 4


def steady_evidence(
    shown: Sequence[Evidence], after: Estimate, training: Observations, criteria: SelectionCriteria = CRITERIA
) -> tuple[Evidence, ...]:
    """Take back that a residual is noise where parts of a recording differ as runs of a changed arm do.

    Friction, torque scale, offset or delay that change within a recording, as with temperature or load, leave what no
    repetition of the motion shows where they change another way in each. Parts are told apart as runs are, see
    `scara_ident.estimation.run_variation`, without what whole runs differ by.

    Parameters
    ----------
    training : Observations
        Of the same model.
    """
    if not any(item.shown for item in shown):
        return tuple(shown)
    robot, worst = training.model.robot, [(0.0, "")] * len(shown)
    for parts in PARTS:
        firsts = _parted(training.owner, parts)
        if firsts is None:
            continue
        found = variation_between(training, training.joints, after.value, firsts, after.variation)
        for joint, item in enumerate(found.joints):
            if item is not None:
                rest = training.joints[joint].left(after.value)
                own = None if after.variation is None else after.variation.joints[joint]
                rest = rest if own is None else rest - own.off
                share = 1.0 - float(np.sum((rest - item.off) ** 2)) / float(np.sum(rest**2))
                worst[joint] = max(worst[joint], (share, _said(item, robot, joint)))
    return tuple(
        replace(
            item,
            shown=False,
            by="",
            why=f"{share:.0%} of the residual's power varies within recordings as if its {what}",
        )
        if item.shown and share > criteria.min_colour
        else item
        for item, (share, what) in zip(shown, worst, strict=True)
    )


def _parted(owner: NDArray[np.intp], parts: int) -> NDArray[np.intp] | None:
    """Return where the parts of every recording begin, and the number of blocks; None where none is long enough for two."""
    edges = np.append(np.flatnonzero(np.diff(owner, prepend=-1)), len(owner))
    counts = np.clip(np.diff(edges) // MIN_BLOCKS, 1, parts)
    if np.max(counts, initial=1) < 2:
        return None
    bounds = zip(edges[:-1], edges[1:], counts, strict=True)
    inner = [np.linspace(first, last, count, endpoint=False).astype(np.intp) for first, last, count in bounds]
    return np.append(np.concatenate(inner), len(owner))


def _said(item: JointVariation, robot: Robot, joint: int) -> str:
    """Say what seems to change most within recordings, by the torque that it makes."""
    place = int(np.argmax(item.std * np.sqrt(np.mean(item.directions**2, axis=1))))
    size = item.std[place]
    units = (
        f"{size:.2g} of itself",
        f"{size:.2g} of itself",
        f"{size:.2g} {robot.torque_unit(joint)}",
        f"{1e3 * size:.2g} ms",
    )
    return f"{KINDS[place]} changed during each recording (standard deviation {units[place]}), differently in each"
