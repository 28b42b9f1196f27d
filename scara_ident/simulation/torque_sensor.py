"""How the torque of the drives is measured: filtered, delayed, averaged, bent, shifted."""

from __future__ import annotations

import numpy as np

from scara_ident.arrays import Array
from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.plant import PlantDraft


def recorded_effort(
    arm: VirtualArm, draft: PlantDraft, effort: Array, position: Array, period: float, window: int
) -> Array:
    """Return the drives' torque as its sensor gives it, without noise: the mean over some periods about each tick.

    Parameters
    ----------
    draft : PlantDraft
        With what its effects do to the measurement.
    effort, position : ndarray, shape (n, N)
        Torque held from each tick to the next, on the effort side, and positions, in the robot's order.
    period : float
        s.
    window : int
        Periods in the mean.

    Returns
    -------
    ndarray, shape (n, N)
    """
    order = arm.robot.order
    n, samples = effort.shape
    ticks = np.arange(samples + 1.0)
    recorded = np.empty((n, samples))
    for i in range(n):
        row = order[i]
        u = _filtered(effort[i], draft.lag[row], period)
        # The torque is constant between ticks, so its integral is linear there and the mean is exact.
        integral = np.concatenate([[0.0], np.cumsum(u)])
        middle = ticks[:-1] - draft.delay[row] / period
        ends = []
        for edge in (middle - 0.5 * window, middle + 0.5 * window):
            inside = np.interp(edge, ticks, integral)
            inside += np.minimum(edge, 0.0) * u[0] + np.maximum(edge - samples, 0.0) * u[-1]
            ends.append(inside)
        u = (ends[1] - ends[0]) / window
        for joint, per_turn, amplitude, phase in draft.pickup:
            if joint == row:
                u = u + amplitude * np.sin(per_turn * position[i] + phase)
        u = u + draft.square[row] * u**2 + draft.cubic[row] * u**3
        recorded[i] = draft.gain[row] * u + draft.shift[row] + draft.drift[row] * ticks[:-1] * period
    return recorded


def _filtered(effort: Array, time_constant: float, period: float) -> Array:
    """Return the mean over each period of a torque after a first-order filter; the torque is constant in each period, and the filter starts at rest."""
    if time_constant == 0.0:
        return effort
    from scipy.signal import lfilter

    kept = np.exp(-period / time_constant)
    # Torque minus the filter's output at each tick: it decays, and every step of the torque adds to it.
    lacking = lfilter([1.0], [1.0, -kept], np.diff(effort, prepend=effort[:1]))
    return np.asarray(effort - lacking * (1.0 - kept) * time_constant / period)
