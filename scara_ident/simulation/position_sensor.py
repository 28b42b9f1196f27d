"""How positions are recorded: after a filter, which the controller does not have."""

from __future__ import annotations

import numpy as np

from scara_ident.arrays import Array
from scara_ident.simulation.plant import PlantDraft


def recorded_position(draft: PlantDraft, measured: Array, period: float) -> Array:
    """Return the encoders' positions after a low-pass filter of first order.

    Parameters
    ----------
    draft : PlantDraft
        With the filter's time constant.
    measured : ndarray, shape (n, N)
        Positions that the encoders give, rad or m.
    period : float
        Time between two samples, s.

    Returns
    -------
    ndarray, shape (n, N)
    """
    if draft.position_lag == 0.0:
        return measured
    from scipy.signal import lfilter

    # The trapezoidal rule: its delay is the time constant exactly.
    steps = 2.0 * draft.position_lag / period
    up, down = np.array([1.0, 1.0]) / (1.0 + steps), np.array([1.0, (1.0 - steps) / (1.0 + steps)])
    # The arm moved before as in the first time constant.
    count = min(max(round(draft.position_lag / period), 1), measured.shape[1] - 1)
    speed = (measured[:, count : count + 1] - measured[:, :1]) / (count * period)
    line = measured[:, :1] + speed * period * np.arange(measured.shape[1])
    return np.asarray(line - draft.position_lag * speed + lfilter(up, down, measured - line, axis=1))
