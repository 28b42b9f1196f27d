"""How well torque repeats: the noise floor, from repetitions of one trajectory."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.arrays import Array
from scara_ident.motion.motion import Stretch, torque_of
from scara_ident.motion.prepared import PreparedData
from scara_ident.motion.trajectories import LARGEST_SHIFT, SAME_RATE, alignment
from scara_ident.threads import side_by_side


def repeatability(data: PreparedData) -> dict[str, Array]:
    """Standard deviation of each joint's torque over the repetitions of each trajectory.

    The sigma of Indri et al. (2002, Table 1): repetitions are aligned in time by their positions, and the
    scatter of the torque about its mean over repetitions is pooled over time.

    Parameters
    ----------
    data : PreparedData
        In any bands.

    Returns
    -------
    dict of str to ndarray, shape (n,)
        By trajectory, for those with at least two repetitions of the same motion.
    """
    groups: dict[str, list[Stretch]] = {}
    for label, item in zip(data.labels, data.recordings, strict=True):
        if item.recording.effort is not None:
            groups.setdefault(label, []).append(item.longest.stretch)
    repeated = {trajectory: group for trajectory, group in groups.items() if len(group) > 1}
    found = side_by_side(_scatter, repeated.values())
    return {trajectory: sigma for trajectory, sigma in zip(repeated, found, strict=True) if sigma is not None}


def _scatter(longest: Sequence[Stretch]) -> Array | None:
    """Scatter about the mean of the repetitions of one motion, of the first sample rate that has any."""
    for place, first in enumerate(longest[:-1]):
        aligned = [(torque_of(first), 0)]
        for other in longest[place + 1 :]:
            if abs(other.rate / first.rate - 1.0) > SAME_RATE:
                continue
            shift = alignment(first.position, other.position, round(LARGEST_SHIFT * first.rate))
            if shift is not None:
                aligned.append((torque_of(other), shift))
        # The samples that all of them have.
        start = max(shift for _, shift in aligned)
        stop = min(torque.shape[1] + shift for torque, shift in aligned)
        if len(aligned) > 1 and start < stop:
            own = [torque[:, start - shift : stop - shift] for torque, shift in aligned]
            mean = sum(own[1:], start=own[0]) / len(own)
            square = np.sum([np.mean((torque - mean) ** 2, axis=1) for torque in own], axis=0)
            return np.asarray(np.sqrt(square / (len(own) - 1)))
    return None
