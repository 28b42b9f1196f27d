"""How far a simulated arm drifts from a recorded one that has the same torques."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from scara_ident.arrays import Array
from scara_ident.errors import LostArm
from scara_ident.motion.prepared import PreparedStretch
from scara_ident.simulation.arm import VirtualArm
from scara_ident.simulation.effects import Effect
from scara_ident.simulation.simulate import free_motion
from scara_ident.use.mujoco_arm import STEP, Free

# Starts along a recording, at the most.
STARTS = 40
HORIZONS = (0.05, 0.1, 0.2, 0.5)


def virtual_free(arm: VirtualArm, effects: Sequence[Effect]) -> Free:
    """Return the free motion of a virtual arm; effects that depend on the time since a run began start anew each time.

    Torque is a straight line from each sample to the next; held, it would come half a sample late.
    """

    def free(q: Array, v: Array, torque: Array, rate: float) -> Array:
        samples = torque.shape[1]
        ticks = int(np.ceil(1.0 / (rate * STEP)))
        middles = (np.arange((samples - 1) * ticks + 1) + 0.5) / ticks
        held = np.array([np.interp(middles, np.arange(samples), own) for own in torque])
        duration = (samples - 1) / rate
        try:
            _, true = free_motion(arm, q, v, duration, torque=held, effects=effects, rate=ticks * rate)
        except LostArm:
            return np.full_like(torque, np.inf)
        return true.every(ticks).position

    return free


def rollout_errors(free: Free, part: PreparedStretch, horizons: Sequence[float] = HORIZONS) -> Array:
    """Return how far a simulated arm is from the recorded one some time after both were at the same state.

    From many places of a recording where all joints move the arm goes on with the recorded torque alone, without a controller.

    Parameters
    ----------
    free : Free
        Of the simulated arm: `virtual_free` or `mujoco_arm`.
    part : PreparedStretch
        Of a recording with effort; its filtered motion gives the states.
    horizons : sequence of float, optional
        s.

    Returns
    -------
    ndarray, shape (len(horizons), n)
        Rms distance of positions, rad or m; NaN where all joints move at no moment before its end, infinite where friction
        drives the simulated arm out of all bounds, as a polynomial can beyond the speeds that it was fitted to.
    """
    motion, rate = part.motion, part.rate
    longest = round(max(horizons) * rate)
    # At rest dry friction is anything that holds the joint, which no state tells.
    moving = np.flatnonzero(np.all(part.used, axis=0))
    moving = moving[moving < part.samples - part.trim - longest]
    square = np.zeros((len(horizons), len(motion.q)))
    if not len(moving):
        return np.full(square.shape, np.nan)
    places = moving[np.unique(np.linspace(0, len(moving) - 1, STARTS).astype(int))]
    steps = np.array([round(horizon * rate) for horizon in horizons])
    for k in places:
        position = free(motion.q[:, k], motion.v[:, k], part.torque[:, k : k + longest + 1], rate)
        if not np.all(np.isfinite(position)):
            return np.full(square.shape, np.inf)
        square += ((position[:, steps] - motion.q[:, k + steps]) ** 2).T
    return np.sqrt(square / len(places))
