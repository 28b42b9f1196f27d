"""The columns of a recording, as a table or a file has them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from scara_ident.arrays import Array
from scara_ident.robot.signal_map import SIGNALS

if TYPE_CHECKING:
    from scara_ident.recording.recording import Recording


def recording_columns(recording: Recording, effort_gain: Array | None = None) -> dict[str, Array]:
    """Return ``time`` and ``<joint>.<signal>`` of every signal that was recorded.

    Parameters
    ----------
    effort_gain : ndarray, shape (n,), optional
        The robot's gains, by which efforts are divided.

    Returns
    -------
    dict of str to ndarray, shape (N,)
    """
    columns = {"time": recording.time}
    for signal in SIGNALS:
        if (values := getattr(recording, signal)) is None:
            continue
        if signal == "effort" and effort_gain is not None:
            values = values / np.asarray(effort_gain, dtype=float)[:, None]
        there = zip(recording.joints, values, strict=True)
        columns |= {f"{joint}.{signal}": row for joint, row in there if not np.isnan(row).all()}
    return columns
