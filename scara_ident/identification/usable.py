"""Which recordings can be used: one that says nothing is left out and named, and only if none is left it is an error."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.errors import RecordingError
from scara_ident.estimation.observations import Observations, kept_rows
from scara_ident.motion.motion import torque_of
from scara_ident.motion.prepared import PreparedData, prepare
from scara_ident.recording.recording import Recording

# An rms of so many independent values is known to 1 / sqrt(2 N), here 22 % (the standard error of a standard deviation).
LEAST_ROWS = 10


def usable_data(recordings: Sequence[Recording], *, needed: bool) -> tuple[PreparedData, list[str]]:
    """Make recordings ready, without those that have no effort or no four samples in a row, and say which.

    Parameters
    ----------
    recordings : sequence of Recording
    needed : bool
        Whether at least one has to be left.

    Raises
    ------
    RecordingError
        That of the first recording, if one is needed and none is left.
    """
    kept, notes, errors = [], [], []
    for recording in recordings:
        try:
            (item,) = prepare([recording]).recordings
            torque_of(item.longest.stretch)
        except RecordingError as error:
            errors.append(error)
            notes.append(f"{error}; left out")
        else:
            kept.append(item)
    if needed and not kept:
        raise errors[0]
    return PreparedData(tuple(kept), kept[0].bands if kept else ()), notes


def with_rows(data: PreparedData, *, needed: bool) -> tuple[PreparedData, list[str]]:
    """Return recordings in their bands without those that have next to no rows, and say which.

    Parameters
    ----------
    data : PreparedData
    needed : bool
        Whether at least one has to be left; if all have too few, all are.
    """
    rows = [kept_rows(item) for item in data.recordings]
    kept = [k for k, count in enumerate(rows) if count >= LEAST_ROWS]
    if len(kept) == len(rows) or (needed and not kept):
        return data, []
    notes = [
        f"{item.recording.path or item.name}: {count} independent rows are left once the ends and the times at rest are left "
        "out; left out"
        for item, count in zip(data.recordings, rows, strict=True)
        if count < LEAST_ROWS
    ]
    return data.of(kept), notes


def check_rows(observations: Observations) -> None:
    """Refuse fewer rows than parameters: they would be met exactly, whatever they are, and predict nothing.

    Raises
    ------
    RecordingError
    """
    rows = sum(joint.table.shape[1] for joint in observations.joints)
    told = np.zeros(observations.parameters, dtype=bool)
    for joint in observations.joints:
        told[joint.columns[np.any(joint.table[:-1] != 0.0, axis=1)]] = True
    if rows <= np.count_nonzero(told):
        first = observations.data.sources[0]
        raise RecordingError(
            f"{first.path or first.name}: {rows} independent rows within the bands for {np.count_nonzero(told)} parameters; "
            "record longer, or give a wider band"
        )
