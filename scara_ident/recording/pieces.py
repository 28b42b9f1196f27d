"""Which recordings are pieces of one: where one ends in motion, the next goes on."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from scara_ident.arrays import Array
from scara_ident.recording.recording import Recording

# Samples over which the speed at an end is taken, so that an encoder's steps hardly count.
END = 6
# A piece begins where the one before it goes to, but for this share of what its joints move in a sample. Two runs that meet
# by chance, in all joints, do so on their way once in a run's samples to the power of its joints.
GONE_ON = 0.5


def of_one_run(recordings: Sequence[Recording]) -> NDArray[np.intp]:
    """Say of every recording which run it is of: pieces that one recording in motion was cut into are of one.

    Whole periods of a motion, which go on to one another whoever recorded them when, are no pieces.

    Returns
    -------
    ndarray of int, shape (recordings,)
        The place of the first piece of its run.
    """
    run = np.arange(len(recordings))
    periods = [_goes_on(item, item) for item in recordings]
    for place, later in enumerate(recordings):
        for other, before in enumerate(recordings):
            if other != place and not (periods[place] or periods[other]) and _goes_on(before, later):
                run[run == max(run[place], run[other])] = min(run[place], run[other])
    return run


def _goes_on(before: Recording, later: Recording) -> bool:
    if before.joints != later.joints or min(len(before.time), len(later.time)) < END:
        return False
    end, begin = before.position[:, -END:], later.position[:, :END]
    slope = 0.5 * (_slope(end) + _slope(begin))
    middle = (END - 1) / 2.0
    # Both lines at the middle of the gap between the samples, by the speed of either side.
    miss = np.mean(begin, axis=1) - np.mean(end, axis=1) - (2.0 * middle + 1.0) * slope
    return float(np.linalg.norm(miss)) < GONE_ON * float(np.linalg.norm(slope))


def _slope(position: Array) -> Array:
    """Return what joints move in a sample, shape (n,), by the line through their positions, shape (n, N)."""
    number = np.arange(position.shape[1]) - 0.5 * (position.shape[1] - 1)
    return np.asarray(position @ number / (number @ number))
